"""The parts of perception that recognise and keep a map: all that is compiled, apart from what the ring hears.

They are imported when recognition begins, as importing and loading them takes longer than a robot should wait.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final, NamedTuple

from config.model import ModelConfig
from config.robot import RingConfig
from config.settings import PerceptionConfig, SurfacesConfig
from config.world import WorldConfig
from drivers.messages import Pose
from perception.edits import PlaceRobot, invalid_pose
from perception.localization.odometry_frame import OdometryFrame
from perception.mapping.no_surfaces import NoSurfaces
from perception.no_method import NoMethod
from perception.snapshot import put_back, snapshot_of

if TYPE_CHECKING:
    from perception.localization.known_room.known_room import KnownRoom
    from perception.localization.submaps.echo_lag import EchoLag
    from perception.mapping.grid.evidence_grid import EvidenceGrid
    from perception.method import Method


class Recognition(NamedTuple):
    """What begins when recognition does."""

    method: Method
    other: Method | None
    """A second method, for the correction of drift."""
    map_frame: OdometryFrame
    known_room: KnownRoom | None
    grid: EvidenceGrid | None
    surfaces: NoSurfaces
    echo_lag: EchoLag | None


NO_RECOGNITION: Final = Recognition(NoMethod(), None, OdometryFrame(), None, None, NoSurfaces(), None)


class PreparedRecognition(NamedTuple):
    """Parts that were made before recognition begins: to use their memory for the first time takes 10 ms."""

    settings: tuple[RingConfig, tuple[ModelConfig, ...], PerceptionConfig]
    parts: Recognition


def prepare_recognition(
    ring: RingConfig, models: tuple[ModelConfig, ...], config: PerceptionConfig
) -> PreparedRecognition:
    """Return what `begin_recognition` returns later with the same settings."""
    return PreparedRecognition((ring, models, config), begin_recognition(ring, models, config))


def begin_recognition(
    ring: RingConfig,
    models: tuple[ModelConfig, ...],
    config: PerceptionConfig,
    ready: PreparedRecognition | None = None,
) -> Recognition:
    """Return the parts that the settings name, with an empty map: those that are ready, if they are of these."""
    if ready is not None and ready.settings == (ring, models, config):
        return ready.parts
    from perception.localization.map_frame import MapFrame
    from perception.localization.submaps.echo_lag import EchoLag
    from perception.mapping.grid.evidence_grid import EvidenceGrid
    from perception.method import make_method

    corrects = config.localization.correct_drift
    return Recognition(
        make_method(ring, models, config),
        make_method(ring, models, config) if corrects else None,
        MapFrame(ring, models) if corrects else OdometryFrame(),
        find_in_room(config.localization.known_room, ring),
        None if config.grid.method == "off" else EvidenceGrid(ring, config.grid),
        _map_surfaces(ring, models, config.surfaces) if config.maps_surfaces else NoSurfaces(),
        EchoLag(ring) if config.localization.finds_echo_lag(ring) else None,
    )


def _map_surfaces(ring: RingConfig, models: Sequence[ModelConfig], config: SurfacesConfig) -> NoSurfaces:
    from perception.mapping.surfaces.surface_map import SurfaceMap

    return SurfaceMap(ring, models, config)


def find_in_room(room: WorldConfig | None, ring: RingConfig) -> KnownRoom | None:
    """Return what finds the robot in a room; None without a room."""
    if room is None:
        return None
    from perception.localization.known_room.known_room import KnownRoom
    from perception.localization.room.room import room_of

    return KnownRoom(room_of(room), ring)


def with_window(known_room: KnownRoom | None, room: WorldConfig | None, ring: RingConfig) -> KnownRoom | None:
    """Return what finds the robot in the same room with a ring that listens up to another range; it knows as much."""
    found = find_in_room(room, ring)
    if found is not None and known_room is not None:
        put_back(found, snapshot_of(known_room))
        found.drop_table()
    return found


def place_robot(known_room: KnownRoom | None, edit: PlaceRobot) -> str | None:
    """Take an operator's place of the robot as right; return None, or why not, as text for the operator."""
    if known_room is None:
        return "there is no known room: start with --map, or load a map"
    refused = invalid_pose(edit.x, edit.y, edit.theta)
    if refused is None:
        known_room.assume(Pose(edit.x, edit.y, edit.theta))
    return refused
