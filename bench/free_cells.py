"""Cells that a grid calls free although no sound could have passed there, in random rooms whose truth is known.

A cell is reachable if a straight line from some sensor that fired, inside its beam, meets some part of the cell
before any surface. The robot's own body frees what it covers.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Final, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray

from bench.trials.furnished_rooms import ACOUSTICS, FurnishedRoom, furnished_room
from bench.trials.wall_trials import listen, reported_walls
from config.robot import RingConfig
from config.settings import Settings
from config.units import FOOT_M
from config.world import AcousticsConfig
from drivers.emulator.acoustics import SIGHT_SLACK_M, hidden
from drivers.emulator.scene import Scene, compile_scene
from drivers.emulator.sonar import Sonar
from drivers.emulator.surfaces import Records
from drivers.messages import Firing, Floats
from perception.kernel import kernel
from perception.localization.room.expected_ranges import Reflection
from perception.mapping.grid.window import Ring, placed
from perception.pipeline import Perception
from perception.sensor_mounts import mounts_array
from runtime.analysis.export.occupancy_image import FREE, FREE_MAX, RESOLUTION_M, occupancy_image
from runtime.analysis.export.world_file import world_of
from runtime.analysis.timeline import ECHO, Echoes
from runtime.simulation.open_loop import perceive

STEP_M: Final = 0.5 * FOOT_M
"""Way between two firings of one sensor."""
LATE_SHARE: Final = 0.3
LATE_M: Final = (0.3, 2.0)
"""So many of the silent readings are late strays instead: longer than the nearest surface in the beam by this."""
PARTS: Final = 0.49 * np.array([(0.0, 0.0), (-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)])
"""Points of a cell of side 1 that are tried, from its middle."""
Bools: TypeAlias = NDArray[np.bool_]
Row: TypeAlias = dict[str, float]


@kernel
def mark_reachable(
    points: Floats, beams: Floats, half_angle: float, reach_m: float, slack_m: float, circles: Records,
    segments: Records, out: Bools,
) -> None:  # fmt: skip
    """Write which points a straight line inside some beam reaches before any surface.

    Parameters
    ----------
    points : (n, 2) float
        m.
    beams : (m, 4) float
        Place x, y (m) and axis x, y (unit vector) of each sensor at each of its firings.
    half_angle, reach_m
        Half the beam's width, rad, and its length, m.
    slack_m
        Surfaces nearer than this to a point do not hide it, m.
    circles, segments
        The surfaces, as of `drivers.emulator.scene.Scene`.
    out : (n,) bool
        Out.
    """
    cosine = math.cos(half_angle)
    for n in range(points.shape[0]):
        out[n] = False
        for m in range(beams.shape[0]):
            dx = points[n, 0] - beams[m, 0]
            dy = points[n, 1] - beams[m, 1]
            d = math.sqrt(dx * dx + dy * dy)
            if d > reach_m or dx * beams[m, 2] + dy * beams[m, 3] < cosine * d:
                continue
            if not hidden(beams[m, 0], beams[m, 1], points[n, 0], points[n, 1], slack_m, circles, segments):
                out[n] = True
                break


def reachable(cells: Floats, cell_m: float, beams: Floats, ring: Ring, scene: Scene) -> Bools:
    """Return which cells, given by their middles (n, 2) m, sound could have reached in part."""
    found = np.zeros(len(cells), np.bool_)
    axes = np.column_stack([beams[:, :2], np.cos(beams[:, 2]), np.sin(beams[:, 2])])
    for part in PARTS:
        rest = np.flatnonzero(~found)
        out = np.zeros(len(rest), np.bool_)
        mark_reachable(
            cells[rest] + cell_m * part, axes, ring.half_angle, ring.reach_m, SIGHT_SLACK_M, scene.circles,
            scene.segments, out,
        )  # fmt: skip
        found[rest] = out
    return found


def with_late_strays(
    firings: Iterable[Firing], ring: RingConfig, scene: Scene, rng: np.random.Generator
) -> list[Firing]:  # fmt: skip
    """Return firings in which some silent readings are echoes that came round: longer than a surface in the beam."""
    cone = Sonar(ring, scene, AcousticsConfig(model="cone"), rng)
    found = []
    for firing in firings:
        nearest = cone.true_echoes(firing.pose, firing.ring_yaw, ~np.isnan(firing.ranges_m))["distance"]
        late = nearest + rng.uniform(*LATE_M, len(nearest))
        is_late = np.isposinf(firing.ranges_m) & (rng.random(len(late)) < LATE_SHARE) & (late < ring.range_max_m)
        found.append(replace(firing, ranges_m=np.where(is_late, late, firing.ranges_m)))
    return found


def placed_ring(ring: RingConfig) -> Ring:
    """Return a ring's sensors as they are placed."""
    half_angle = math.radians(ring.beam_half_angle_deg)
    return Ring(mounts_array(ring.mounts), half_angle, 0.0, ring.range_max_m, ring.turning)


def beams_of(firings: Iterable[Firing], ring: Ring) -> Floats:
    """Return place x, y (m) and direction (rad) of each sensor that fired, shape (n, 3)."""
    return np.concatenate([np.array(placed(firing, ring))[~np.isnan(firing.ranges_m)] for firing in firings])


def echoes_of(firings: Iterable[Firing], ring: Ring) -> Echoes:
    """Return the readings of firings as a timeline holds them."""
    parts = []
    for k, firing in enumerate(firings):
        fired = np.flatnonzero(~np.isnan(firing.ranges_m))
        rows = np.zeros(len(fired), ECHO)
        rows["t_s"] = rows["robot_s"] = 0.1 * k
        rows["sensor"], rows["range_m"] = fired, firing.ranges_m[fired]
        rows["x"], rows["y"], rows["bearing"] = np.array(placed(firing, ring))[fired].T
        parts.append(rows)
    return np.concatenate(parts)


@dataclass(frozen=True, slots=True)
class FreeTrial:
    """What a grid calls free in a room.

    Attributes
    ----------
    free, unreachable : int
        Cells that are called free, and those of them that no sound could reach.
    reachable, found : int
        Cells that sound could reach or the body covered, and those of them that are called free.
    """

    free: int
    unreachable: int
    reachable: int
    found: int


def try_room(settings: Settings, room: FurnishedRoom, seed: int, *, late: bool) -> dict[str, FreeTrial]:
    """Drive through a room; return what perception's grid and the exported image call free.

    Parameters
    ----------
    settings : Settings
        The robot and its perception, with a grid.
    room : FurnishedRoom
        The room.
    seed : int
        Of the drive and the noise.
    late : bool
        Whether some silent readings become late strays.
    """
    ring = placed_ring(settings.ring)
    scene = compile_scene(room.world)
    firings: list[Firing] = list(listen(settings.ring, room, seed, STEP_M).firings)
    if late:
        firings = with_late_strays(firings, settings.ring, scene, np.random.default_rng([seed, 41]))
    perception = Perception(settings.ring, settings.models, settings.perception)
    for firing in firings:
        perceive(perception, firing)
    seen, beams = perception.labelled_objects(), beams_of(firings, ring)
    window = perception.occupancy()
    assert window is not None
    walls = np.array([[*line.begin, *line.end] for line in reported_walls(seen)]).reshape(-1, 4)
    way = np.array([(firing.pose.x, firing.pose.y) for firing in firings])
    world = world_of([one for one in seen if one.ends is None], walls, settings.models)
    image = occupancy_image(world, echoes_of(firings, ring), settings.ring, way, settings.body.radius_m)
    parts = {
        "grid": (window.occupied <= FREE_MAX, window.x_m, window.y_m, window.cell_m),
        "image": (image.pixels[::-1] == FREE, image.x_m, image.y_m, RESOLUTION_M),
    }
    found = {}
    for name, (is_free, x_m, y_m, cell_m) in parts.items():
        rows, columns = (part.ravel() for part in np.indices(is_free.shape))
        cells = np.column_stack([x_m + (columns + 0.5) * cell_m, y_m + (rows + 0.5) * cell_m])
        can = reachable(cells, cell_m, beams, ring, scene)
        for span in range(0, len(way), 50):
            off = cells[:, None] - way[None, span : span + 50]
            can |= (np.hypot(off[..., 0], off[..., 1]) < settings.body.radius_m + cell_m).any(axis=1)
        free = is_free.ravel()
        found[name] = FreeTrial(int(free.sum()), int((free & ~can).sum()), int(can.sum()), int((free & can).sum()))
    return found


def measure(settings: Settings, seeds: Iterable[int], report: Callable[[str], None]) -> dict[str, Row]:
    """Return the shares of wrongly free cells by what calls them so, by reflection and by late strays.

    Parameters
    ----------
    settings
        The robot and its perception, with a grid.
    seeds
        Which random rooms.
    report
        Called with a line on what is running.
    """
    rows: dict[str, Row] = {}
    seeds = tuple(seeds)
    for reflection in get_args(Reflection):
        acoustics = ACOUSTICS.model_copy(update={"model": reflection})
        for late in (False, True) if reflection == "specular" else (False,):
            trials: dict[str, list[FreeTrial]] = {}
            for seed in seeds:
                report(f"free cells: {reflection}{', late strays' if late else ''}, room {seed}")
                for name, trial in try_room(settings, furnished_room(seed, acoustics), seed, late=late).items():
                    trials.setdefault(name, []).append(trial)
            for name, of in trials.items():
                free, wrong = sum(one.free for one in of), sum(one.unreachable for one in of)
                rows[f"{name}: {reflection}{', late strays' if late else ''}"] = {
                    "rooms": len(of), "free cells": free, "unreachable, %": 100.0 * wrong / max(1, free),
                    "worst room, %": max(100.0 * one.unreachable / max(1, one.free) for one in of),
                    "reachable called free, %": 100.0 * sum(o.found for o in of) / sum(o.reachable for o in of),
                }  # fmt: skip
    return rows
