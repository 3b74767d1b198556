"""Session information, the first message to the page: robot, models, an emulator's true world, a known room."""

from __future__ import annotations

import contextlib
import functools
import math

from config.errors import UserError
from config.load import list_shipped, load_mission
from config.mission import MissionConfig
from config.mission_step import LABELS
from config.settings import Settings
from config.world import StartConfig, WorldConfig
from drivers.messages import Pose
from drivers.registry import driver_names
from perception.bayes.memory.elements import round_label
from perception.bayes.memory.parameters import RIVAL_RADII_M
from runtime import VERSION
from runtime.console.commands.parameters import parameters
from runtime.console.sent_messages import SessionInfo, SurfacesRow
from runtime.support.length_format import Units


def session_info(settings: Settings, *, name: str | None, emulated: bool, units: Units) -> SessionInfo:
    """Return the session message that all clients are sent; the hub adds the client's role.

    `name` is what the robot calls itself; `units` are those in which the page shows lengths at first.
    """
    ring, body, known_room = settings.ring, settings.body, settings.perception.localization.known_room
    return {
        "type": "session",
        "version": VERSION,
        "name": name,
        "emulated": emulated,
        "units": units,
        "ring": {
            "mounts": [(mount.x_m, mount.y_m, mount.angle_rad) for mount in ring.mounts],
            "turning": ring.turning,
            "half_angle": math.radians(ring.beam_half_angle_deg),
            "range_min": ring.range_min_m,
            "range_max": ring.range_max_m,
        },
        "body": {"radius": body.radius_m, "speed_max": body.speed_max_m_s, "turn_max": body.turn_max_rad_s},
        "models": [
            {"name": m.name, "vertices": m.vertices_m, "closed": m.closed, "arc_radius_m": m.arc_radius_m}
            for m in settings.models
        ],
        "radii": {round_label(radius_m): radius_m for radius_m in RIVAL_RADII_M},
        "missions": [{"name": m.name, "about": m.about} for m in missions(settings)],
        "truth": surfaces(settings.world, settings.world.start) if emulated and settings.world is not None else None,
        "known_room": None if known_room is None else surfaces(known_room, StartConfig()),
        "drivers": driver_names(),
        "parameters": parameters(settings),
        "budget_s": settings.cycle.perception_budget_s,
        "period_s": 1.0 / settings.cycle.rate_hz,
    }


def missions(settings: Settings) -> list[MissionConfig]:
    """Return the missions that an operator can start: the run's own, and those of the shipped ones it can drive."""
    known = {*(model.name for model in settings.models), *LABELS}
    shipped = [mission for mission in shipped_missions() if mission.objects() <= known]
    own = settings.mission
    return shipped if own is None else [own, *(mission for mission in shipped if mission.name != own.name)]


@functools.cache
def shipped_missions() -> tuple[MissionConfig, ...]:
    """Return the missions that are shipped or that packages add, but for those whose files are wrong; read once."""
    found = []
    for name in list_shipped("missions"):
        with contextlib.suppress(UserError):  # as one that a package adds; `echolocate check` says what is wrong
            found.append(load_mission(name))
    return tuple(found)


def surfaces(world: WorldConfig, start: StartConfig) -> SurfacesRow:
    """Return the drums, walls and polygons of a world, m, in the frame of an odometry that begins at this start."""
    odom_from_world = _pose(start).inverse()

    def in_odom(x: float, y: float) -> tuple[float, float]:
        place = odom_from_world.compose(Pose(x, y, 0.0))
        return place.x, place.y

    polygons = [[in_odom(*vertex) for vertex in polygon.vertices_m] for polygon in world.polygon]
    polygons += [[in_odom(*corner) for corner in box.corners_m()] for box in world.box]
    return {
        "drums": [(*in_odom(drum.x_m, drum.y_m), drum.radius_m) for drum in world.drum],
        "walls": [(*in_odom(x1, y1), *in_odom(x2, y2)) for wall in world.wall for x1, y1, x2, y2 in wall.pieces_m()],
        "polygons": polygons,
    }


def _pose(start: StartConfig) -> Pose:
    return Pose(start.x_m, start.y_m, math.radians(start.heading_deg))
