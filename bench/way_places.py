"""The place without a map in generated rooms without drums, in a bare corridor, and on a long way.

In rooms the errors of odometry are those of the drift trials; the same drive by exact odometry shows which walls are
found without drift. Corridor and long way have the ring of `bench.laser_rooms`, which fires every 0.1 m.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable
from itertools import pairwise
from statistics import mean
from typing import Final

import numpy as np

from bench.beacons import errors_when_aligned
from bench.building_places import FIRING_S, drive
from bench.correction import Wall, unmatched
from bench.correction_drives import CorrectionDrive, correction_drive, level_name, room_of
from bench.laser_rooms import RING
from bench.real_places import Followed, followed, place_errors, rms
from bench.real_rooms import Row
from bench.trials.known_room_trials import drifting_odometry
from config.load import load_settings
from config.world import AcousticsConfig, WallConfig, WorldConfig
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.messages import Firing, Floats, Pose, wrap_angle
from perception.localization.submaps.submap_graph import SubmapGraph
from runtime.simulation.drift_trials import LEVELS
from runtime.timing.footprint import own_mb

DRUMLESS: Final = ("boxes", "clutter")
SECONDS: Final = 180.0
"""Of a drive: 40 to 50 m, which passes each place of a room about three times."""
CHI2_95_ONE: Final = 3.841
"""Of one degree of freedom."""
CORRIDOR_M: Final = 60.0
HALF_WIDTH_M: Final = 1.0
DOORWAYS_M: Final = (18.0, 41.0)
DOORWAY_M: Final = (0.9, 0.3)
"""Where two doorways of the left wall begin, their width, and how deep they lie in it."""
STEP_M: Final = 0.1
BLOCK_M: Final = (24.0, 16.0)
"""Length and width of a round of corridors; rounds lie side by side."""
BLOCKS: Final = 12
"""Blocks in a row, of which each is driven round twice before the next; then the row from the start."""
NEAR_M: Final = 6.0
"""Walls so far from a block are heard in it."""
PART_M: Final = 100.0
"""Way at the begin, and at the end, whose firings are compared."""


def measure_rooms(rooms: int, first: int, tell: Callable[[str], None]) -> dict[str, Row]:
    """Return the figures of drives in so many rooms without drums, by level of odometry's errors."""
    seeds = [seed for seed in range(first, first + 8 * rooms) if room_of(seed) in DRUMLESS][:rooms]
    rows: dict[str, list[Row]] = {level_name(level): [] for level in LEVELS[1:]}
    for seed in seeds:
        tell(f"room {seed}, exact")
        exact = _walls(_follow(correction_drive(seed, LEVELS[0], SECONDS)))
        for level in LEVELS[1:]:
            tell(f"room {seed}, {level_name(level)}")
            rows[level_name(level)].append(_in_room(correction_drive(seed, level, SECONDS), exact))
    return {name: {key: mean(row[key] for row in some) for key in some[0]} for name, some in rows.items()}


def _follow(one: CorrectionDrive) -> Followed:
    return followed(one.settings, one.firings)


def _in_room(one: CorrectionDrive, exact: list[Wall]) -> Row:
    found, truth = _follow(one), np.array([(at.x, at.y, at.theta) for at in one.truth])
    odometry = np.array([(firing.pose.x, firing.pose.y, firing.pose.theta) for firing in one.firings])
    here, walls = found.now[-1], _walls(found)
    off = np.array([here.pose.x, here.pose.y, here.pose.theta]) - truth[-1]
    off[2] = wrap_angle(off[2])
    return {
        **place_errors(found, odometry, truth),
        "NEES of the pose": float(off @ np.linalg.solve(here.covariance, off)),
        "walls": len(walls), "walls of exact odometry": len(exact),
        "walls that moved": unmatched(walls, exact), "false drums": len(found.summary["objects"]),
    }  # fmt: skip


def _walls(found: Followed) -> list[Wall]:
    return [(one["x1"], one["y1"], one["x2"], one["y2"]) for one in found.summary["walls"]]


def corridor_walls() -> Floats:
    """Return the walls of the bare corridor along the x axis, whose ends are far away, shape (n, 4), m."""
    far, (width, depth) = 12.0, DOORWAY_M
    line = [(-far, HALF_WIDTH_M)]
    for doorway in DOORWAYS_M:
        steps = ((doorway, 0.0), (doorway, depth), (doorway + width, depth), (doorway + width, 0.0))
        line += [(x, HALF_WIDTH_M + y) for x, y in steps]
    line.append((CORRIDOR_M + far, HALF_WIDTH_M))
    other = (-far, -HALF_WIDTH_M, CORRIDOR_M + far, -HALF_WIDTH_M)
    return np.array([*((*a, *b) for a, b in pairwise(line)), other])


def measure_corridor(seeds: Iterable[int], tell: Callable[[str], None]) -> dict[str, Row]:
    """Return the figures of drives through the corridor and back, among cones and among mirrors."""
    out = np.arange(0.0, CORRIDOR_M, STEP_M)
    turns = np.arange(0.15, math.pi, 0.15)
    truth = np.concatenate([
        np.column_stack([out, 0.0 * out, 0.0 * out]),
        np.column_stack([np.full(len(turns), CORRIDOR_M), 0.0 * turns, turns]),
        np.column_stack([out[::-1], 0.0 * out, np.full(len(out), math.pi)]),
    ])  # fmt: skip
    settings, rows = load_settings(None).model_copy(update={"ring": RING}), {}
    for model in ("cone", "specular"):
        for seed in seeds:
            tell(f"corridor, {model}, drive {seed}")
            firings = drive(corridor_walls(), truth, AcousticsConfig(model=model), seed)
            odometry = np.array([(one.pose.x, one.pose.y, one.pose.theta) for one in firings])
            rows[f"{model}, {seed}"] = _in_corridor(followed(settings, firings), odometry, truth)
    return rows


def _in_corridor(found: Followed, odometry: Floats, truth: Floats) -> Row:
    """Return the errors across and along the corridor, and how often the truth lay within 95 %."""
    to = Pose(*truth[0].tolist()).compose(Pose(*odometry[0].tolist()).inverse())
    c, s = math.cos(to.theta), math.sin(to.theta)
    turn = np.array([[c, s], [-s, c]])
    said = np.array([(here.pose.x, here.pose.y) for here in found.now]) @ turn + (to.x, to.y)
    spreads = turn.T @ np.array([here.covariance[:2, :2] for here in found.now]) @ turn
    along, across = (said - truth[:, :2]).T
    by_odometry = odometry[:, :2] @ turn + (to.x, to.y) - truth[:, :2]
    return {
        "odometry across": rms(by_odometry[:, 1]), "odometry along": rms(by_odometry[:, 0]),
        "across": rms(across), "along": rms(along),
        "across at the end": float(abs(across[-1])), "along at the end": float(abs(along[-1])),
        "across within 95 %": float((across**2 <= CHI2_95_ONE * spreads[:, 1, 1]).mean()),
        "along within 95 %": float((along**2 <= CHI2_95_ONE * spreads[:, 0, 0]).mean()),
        "wrong": place_errors(found, odometry, truth)["wrong"],
    }  # fmt: skip


def long_way(kilometres: float) -> Floats:
    """Return the poses of a way round blocks of corridors, two rounds each, row after row, shape (n, 3)."""
    length, width = BLOCK_M
    places, way, k = [(0.0, 0.0)], 0.0, 0
    while way < 1000.0 * kilometres:
        x = length * (k % BLOCKS)
        corners = [(x + length, 0.0), (x + length, width), (x, width), (x, 0.0)]
        if k % BLOCKS == 0 and k:
            corners.insert(0, (0.0, 0.0))
        for at in (*corners, *corners, (x + length, 0.0)):
            way += math.dist(places[-1], at)
            places.append(at)
        k += 1
    rows: list[tuple[float, float, float]] = []
    heading = 0.0
    for a, b in pairwise(places):
        apart = math.dist(a, b)
        if apart == 0.0:
            continue
        turn = wrap_angle(math.atan2(b[1] - a[1], b[0] - a[0]) - heading)
        count = math.ceil(abs(turn) / 0.15)
        rows += [(*a, heading + turn * (j + 1) / count) for j in range(count)]
        heading += turn
        steps = round(apart / STEP_M)
        rows += [(*(np.array(a) + (np.array(b) - a) * (j + 1) / steps).tolist(), heading) for j in range(steps)]
    return np.array(rows)


def block_walls() -> WorldConfig:
    """Return the corridors of a row of blocks, 2 m wide, with a doorway in each wall, each at another place."""
    length, width = BLOCK_M
    lines = [(-1.0, -1.0, length * BLOCKS + 1.0, -1.0), (-1.0, width + 1.0, length * BLOCKS + 1.0, width + 1.0)]
    lines += [(x, -1.0, x, width + 1.0) for x in (-1.0, length * BLOCKS + 1.0)]
    rng = np.random.default_rng(42)
    for k in range(BLOCKS):
        low, high = k * length + 1.0, (k + 1) * length - 1.0
        inner = [(low, 1.0), (high, 1.0), (high, width - 1.0), (low, width - 1.0), (low, 1.0)]
        for (ax, ay), (bx, by) in pairwise(inner):
            a, b = np.array([ax, ay]), np.array([bx, by])
            along = (b - a) / np.hypot(*(b - a))
            inward = np.array([-along[1], along[0]]) * DOORWAY_M[1]
            doorway = a + along * float(rng.uniform(2.0, np.hypot(*(b - a)) - 3.0))
            points = [
                a,
                doorway,
                doorway + inward,
                doorway + inward + along * DOORWAY_M[0],
                doorway + along * DOORWAY_M[0],
                b,
            ]
            lines += [(*p.tolist(), *q.tolist()) for p, q in pairwise(points)]
    walls = tuple(WallConfig(x1_m=a, y1_m=b, x2_m=c, y2_m=d) for a, b, c, d in lines)
    return WorldConfig(wall=walls, acoustics=AcousticsConfig(model="cone", noise_relative=0.003))


def measure_long(kilometres: float, seed: int, tell: Callable[[str], None]) -> dict[str, Row]:
    """Return what firings cost on the first and the last 100 m, memory, and errors of the place.

    Times are of the thread; quanta are those of the job that compares a map, done as soon as they can be.
    """
    world, truth = block_walls(), long_way(kilometres)
    rng = np.random.default_rng(np.random.SeedSequence([seed, 42]))
    odometry = drifting_odometry(truth, rng)
    scenes: dict[int, Sonar] = {}
    graph, before_mb = SubmapGraph(RING), own_mb() or math.nan
    took_ms, quanta_ms, said = list[float](), list[float](), list[tuple[float, float]]()
    way, reported_m = 0.0, 0.0
    for k, (pose, row) in enumerate(zip(odometry, truth.tolist(), strict=True)):
        part = int(row[0] // BLOCK_M[0])
        if part not in scenes:
            scenes[part] = _sonar_near(world, part, rng)
        ranges = scenes[part].fire(Pose(*row), row[2], range(len(RING.mounts)))
        begin_s = time.thread_time()
        graph.observe(Firing(FIRING_S * k, pose, pose.theta, ranges))
        here = graph.localized()
        took_ms.append(1e3 * (time.thread_time() - begin_s))
        while graph.can_refine:
            begin_s = time.thread_time()
            graph.refine()
            quanta_ms.append(1e3 * (time.thread_time() - begin_s))
        said.append((here.pose.x, here.pose.y))
        way += math.dist(row[:2], truth[max(k - 1, 0), :2])
        if way - reported_m > PART_M:
            reported_m = way
            tell(f"{way:.0f} m, {graph.count} maps")
    ways = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(truth[:, :2], axis=0).T))])
    begin, end = ways <= PART_M, ways > ways[-1] - PART_M
    first, last = (float(np.quantile(np.array(took_ms)[part], 0.99)) for part in (begin, end))
    moved = np.array([(pose.x, pose.y) for pose in odometry])
    return {
        f"{kilometres:g} km, drive {seed}": {
            "maps": graph.count, "MB": (own_mb() or math.nan) - before_mb,
            "p50 ms": float(np.quantile(took_ms, 0.5)), "p99 ms, first 100 m": first, "p99 ms, last 100 m": last,
            "longest ms": max(took_ms), "ratio": last / first,
            "quantum p99 ms": float(np.quantile(quanta_ms, 0.99)), "longest quantum ms": max(quanta_ms),
            "quanta a map": len(quanta_ms) / max(graph.count, 1),
            "odometry": rms(errors_when_aligned(moved, truth[:, :2])),
            "now": rms(errors_when_aligned(np.array(said), truth[:, :2])),
        }
    }  # fmt: skip


def _sonar_near(world: WorldConfig, part: int, rng: np.random.Generator) -> Sonar:
    """Return the sonar among the walls near one block: the emulator looks at every wall of its scene."""
    low, high = part * BLOCK_M[0] - NEAR_M, (part + 1) * BLOCK_M[0] + NEAR_M
    walls = tuple(w for w in world.wall if max(w.x1_m, w.x2_m) > low and min(w.x1_m, w.x2_m) < high)
    near = world.model_copy(update={"wall": walls})
    return Sonar(RING, compile_scene(near), near.acoustics, rng)
