"""What any rule could know of the corners and edges of a room: the association perfect, and the noise known.

All echoes that came from a point, as they were heard, are explained by a point, by the side of a wall and by a post
of .35 ft, each in its best place. A point that is heard on too short a way is placed badly, or is any of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Final, TypeAlias

import numpy as np

from bench.trials.furnished_rooms import ACOUSTICS, FurnishedRoom, furnished_room
from bench.trials.wall_trials import (
    CORNER_ECHOES_MIN,
    CORNER_WITHIN_M,
    HEARD_SIGMAS,
    ON_WALL_M,
    Corner,
    listen,
)
from config.robot import RingConfig
from config.units import FOOT_M
from config.world import AcousticsConfig
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.messages import Floats

DISTINGUISHED_NAT: Final = 4.0
"""Evidence by which one kind is distinguished from another, nat."""
POST_M: Final = 0.35 * FOOT_M
STEPS: Final = 30
NUDGE: Final = 1e-6
DAMPING: Final = 1e-6
"""Steps of a fit, and for its slopes."""
Predict: TypeAlias = Callable[[Floats, Floats], Floats]
"""Ranges (m) that sensors at places (n, 2) have to something with these parameters."""


def echoes_of_corners(
    ring: RingConfig, room: FurnishedRoom, seed: int, step_m: float
) -> list[tuple[Corner, Floats, Floats]]:
    """Return the corners of a room, with the sensors' places (n, 2) and ranges (n,) of the echoes from each, m.

    Parameters
    ----------
    ring, room, seed, step_m
        As for `wall_trials.listen`.
    """
    heard, acoustics = listen(ring, room, seed, step_m), room.world.acoustics
    sonar = Sonar(ring, compile_scene(room.world), acoustics, np.random.default_rng(seed))
    mounts = np.array(ring.mounts)
    points, places, ranges = [], [], []
    for firing in heard.firings:
        fired = np.isfinite(firing.ranges_m)
        true = sonar.true_echoes(firing.pose, firing.ring_yaw, fired)
        least_m = HEARD_SIGMAS * acoustics.noise_m + ring.resolution_m
        is_heard = fired & np.isclose(
            firing.ranges_m, true["distance"], HEARD_SIGMAS * acoustics.noise_relative, least_m
        )
        c, s = math.cos(firing.ring_yaw), math.sin(firing.ring_yaw)
        turned = mounts[is_heard, :2] @ np.array([[c, s], [-s, c]])
        points.append(np.column_stack([true["x"], true["y"]])[is_heard])
        places.append(turned + np.array([firing.pose.x, firing.pose.y]))
        ranges.append(firing.ranges_m[is_heard])
    point, place, range_m = np.concatenate(points), np.concatenate(places), np.concatenate(ranges)
    own = [np.hypot(*(point - (it.x, it.y)).T) < ON_WALL_M for it in heard.corners]
    return [(it, place[of], range_m[of]) for it, of in zip(heard.corners, own, strict=True)]


def to_circle(radius_m: float) -> Predict:
    """Return the ranges to a circle, of radius 0 to a point; its parameters are those of its centre, m."""
    return lambda at, places: np.asarray(np.hypot(*(at - places).T) - radius_m)


def to_line(at: Floats, places: Floats) -> Floats:
    """Return the ranges to a line, whose parameters are the bearing of its normal and its distance from 0, 0."""
    return np.asarray(np.abs(at[1] - places @ [math.cos(at[0]), math.sin(at[0])]))


def best(
    predict: Predict, starts: Iterable[Floats], places: Floats, ranges: Floats, sigma: Floats
) -> tuple[Floats, float]:
    """Return the parameters that explain ranges best, by damped least squares from several starts, and their χ²."""
    found = []
    for start in starts:
        at, chi2, damping = np.array(start), math.inf, DAMPING
        for _ in range(STEPS):
            error = (ranges - predict(at, places)) / sigma
            slopes = [
                (predict(at + step, places) - predict(at, places)) / NUDGE / sigma for step in NUDGE * np.eye(2)
            ]
            rows = np.column_stack(slopes)
            information = rows.T @ rows
            step = np.linalg.solve(information + damping * np.eye(2) * np.trace(information), rows.T @ error)
            new = float((((ranges - predict(at + step, places)) / sigma) ** 2).sum())
            chi2 = float((error**2).sum())
            at, damping = (at + step, 0.3 * damping) if new <= chi2 else (at, 10.0 * damping)
        found.append((at, chi2))
    return min(found, key=lambda of: of[1])


def judge(corner: Corner, places: Floats, ranges: Floats, acoustics: AcousticsConfig) -> tuple[bool, bool, bool]:
    """Return whether a corner's echoes place it well enough, and whether they tell it from a wall and from a post.

    Parameters
    ----------
    corner, places, ranges
        As returned by `echoes_of_corners`.
    acoustics
        The noise.
    """
    true = np.array([corner.x, corner.y])
    to = true - places
    sigma = np.hypot(acoustics.noise_m, acoustics.noise_relative * np.hypot(*to.T))
    mean = math.atan2(*to.sum(axis=0)[::-1])
    ways = [np.array([math.cos(mean + turn), math.sin(mean + turn)]) for turn in (-1.0, 0.0, 1.0)]
    at, chi2 = best(to_circle(0.0), [true], places, ranges, sigma)
    _, of_post = best(to_circle(POST_M), [true + POST_M * way for way in ways], places, ranges, sigma)
    lines = [np.array([math.atan2(way[1], way[0]), float(way @ true)]) for way in ways]
    _, of_line = best(to_line, lines, places, ranges, sigma)
    is_placed = bool(np.hypot(*(at - true)) < CORNER_WITHIN_M)
    return is_placed, 0.5 * (of_line - chi2) >= DISTINGUISHED_NAT, 0.5 * (of_post - chi2) >= DISTINGUISHED_NAT


def measure(
    ring: RingConfig, seeds: Sequence[int], steps_ft: Iterable[float], report: Callable[[str], None]
) -> dict[str, dict[str, float]]:
    """Return for corners and edges between mirrors the shares that are placed and distinguished, by step.

    Parameters
    ----------
    ring
        The sensors.
    seeds, steps_ft
        The rooms, and the distances between two firings of one sensor, ft.
    report
        Called with a line on what is running.
    """
    rows: dict[str, dict[str, float]] = {}
    for step_ft in steps_ft:
        judged: dict[bool, list[tuple[bool, bool, bool]]] = {False: [], True: []}
        for seed in seeds:
            report(f"corner bound: {step_ft:g} ft, room {seed}")
            for corner, places, ranges in echoes_of_corners(ring, furnished_room(seed), seed, step_ft * FOOT_M):
                if len(ranges) >= CORNER_ECHOES_MIN:
                    judged[corner.is_edge].append(judge(corner, places, ranges, ACOUSTICS))
        for is_edge, name in ((False, "inside corners"), (True, "edges")):
            of = np.array(judged[is_edge]).reshape(-1, 3)
            figures = {
                "placed": of[:, 0],
                "distinguished from a wall": of[:, 1],
                "from a post, too": of[:, 1] & of[:, 2],
            }
            rows[f"{name}, {step_ft:g} ft"] = {
                "heard": len(of), **{what: float(share.mean()) for what, share in figures.items()}
            }  # fmt: skip
    return rows
