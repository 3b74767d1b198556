"""What a robot that stands forgets: what was sure after a drive, in random rooms, and what it says minutes later.

Nothing in the room changes, so each further reading repeats what the robot knew when it stopped. What was sure then
must stay, where it was; what becomes sure must be true; and no sensor may be named as faulty.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias, get_args

import numpy as np

from bench.trials.furnished_rooms import furnished_room
from bench.trials.wall_trials import CORNER_WITHIN_M, RIGHT_RAD, Segment, reported_walls, true_corners
from config.load import load_robot
from config.robot import RingConfig
from config.settings import Settings
from config.world import AcousticsConfig, WorldConfig
from drivers.messages import Floats
from perception.detected_object import DetectedObject
from perception.localization.room.expected_ranges import Reflection
from perception.pipeline import Perception
from tests.perception.wandering import Wandering, ring_with_gaps
from tests.random_robots import random_robot

SURE: Final = 0.99
KINDS: Final = ("wall", "inside corner", "edge", "drum")
DRIVE_S: Final = 60.0
PIECE_M: Final = 0.1
NEAR_M: Final = 0.15
"""An object this far from where it was, or a piece of wall, is still the same one."""
KEPT_SHARE: Final = 0.9
"""A wall is lost if less of it is still sure."""
MOVED_M: Final = 0.05
FALSE_WALL_M: Final = 0.1
FALSE_SHARE: Final = 0.3
FALSE_SINE: Final = math.sin(2.0 * RIGHT_RAD)
"""A wall is false if more than this share of it lies farther than that from any true one in its direction."""
RINGS: Final = ("denning", "p3dx", "b21r", "magellan", "gaps", "random")
"""Shipped robots, a ring with gaps, and a ring of 3 to 24 sensors anywhere."""
NOISY: Final = {"noise_relative": 0.01, "dropout": 0.05, "outliers": 0.03}
Row: TypeAlias = dict[str, float]
Look: TypeAlias = Callable[[Perception, int], None]


def ring_of_room(seed: int) -> RingConfig:
    """Return the ring that drives in a room."""
    name = RINGS[seed % len(RINGS)]
    if name == "gaps":
        return ring_with_gaps(seed)
    return random_robot(seed).ring if name == "random" else load_robot(name).ring


def pieces(wall: Segment) -> Floats:
    """Return points along a wall, `PIECE_M` apart, shape (n, 2)."""
    count = max(1, round(wall.length_m / PIECE_M))
    return wall.begin + ((np.arange(count) + 0.5) / count)[:, None] * (wall.end - wall.begin)


def moved_m(before: DetectedObject, now: Sequence[DetectedObject]) -> float:
    """Return how far a sure object is from the nearest sure one of its kind, m; of a wall, its least kept piece."""
    same = [one for one in now if one.model == before.model]
    if before.ends is None:
        return min((math.dist((one.x, one.y), (before.x, before.y)) for one in same), default=math.inf)
    (own,), walls = reported_walls([before]), reported_walls(same)
    away = np.sort(np.min([wall.distance(pieces(own)) for wall in walls], axis=0)) if walls else np.array([math.inf])
    return float(away[math.ceil(KEPT_SHARE * len(away)) - 1])


def is_true(one: DetectedObject, world: WorldConfig) -> bool:
    """Return whether such an object stands there."""
    walls = [Segment(np.array([w.x1_m, w.y1_m]), np.array([w.x2_m, w.y2_m])) for w in world.wall]
    if one.ends is not None:
        points, (tx, ty) = pieces(*reported_walls([one])), (math.cos(one.theta), math.sin(one.theta))
        beside = [wall for wall in walls if abs(tx * wall.direction[1] - ty * wall.direction[0]) < FALSE_SINE]
        away = np.min([wall.distance(points) for wall in beside], axis=0, initial=math.inf)
        return bool(np.mean(away > FALSE_WALL_M) <= FALSE_SHARE)
    if one.model == "drum":
        return any(math.dist((it.x_m, it.y_m), (one.x, one.y)) < NEAR_M for it in world.drum)
    corners = [it for it in true_corners(walls) if it.is_edge == (one.model == "edge")]
    return any(math.dist((it.x, it.y), (one.x, one.y)) < CORNER_WITHIN_M for it in corners)


def sure(perception: Perception) -> list[DetectedObject]:
    """Return the walls, corners and drums that are as good as certain."""
    return [one for one in perception.labelled_objects() if one.model in KINDS and (one.probability or 0.0) > SURE]


@dataclass(frozen=True, slots=True)
class StandTrial:
    """What became of what was sure, in one room.

    Attributes
    ----------
    known
        What was sure when the robot stopped.
    lost
        Those of it that were not in some later minute, and that minute.
    moved
        Those of the others that were elsewhere at the end, and how far, m.
    false
        What of it was false.
    new_false
        What was sure at the end alone, and false.
    named
        Sensors that were named as faulty.
    """

    known: list[DetectedObject]
    lost: list[tuple[DetectedObject, int]]
    moved: list[tuple[DetectedObject, float]]
    false: list[DetectedObject]
    new_false: list[DetectedObject]
    named: set[tuple[int, str]]

    def of(self, kind: str) -> Row:
        """Return the counts of a kind of object, by what became of it."""
        parts = {
            "sure at the stop": self.known, "false": self.false, "lost": [one for one, _ in self.lost],
            "moved": [one for one, _ in self.moved], "new and false": self.new_false,
        }  # fmt: skip
        return {name: sum(one.model == kind for one in part) for name, part in parts.items()}


def no_look(perception: Perception, minute: int) -> None:
    """Do nothing; the default of `try_standing`."""


def acoustics_of(model: Reflection, seed: int) -> AcousticsConfig:
    """Return the acoustics of a room: every fourth is without noise."""
    return AcousticsConfig.model_validate({"model": model, **({} if seed % 4 == 0 else NOISY)})


def try_standing(
    settings: Settings, seed: int, model: Reflection, stand_s: float, look: Look = no_look, settle_s: float = 0.0
) -> StandTrial:  # fmt: skip
    """Drive through a room, stand, and return what became of what was sure.

    Parameters
    ----------
    settings : Settings
        Models and perception.
    seed : int
        Which room, ring, drive and noise.
    model : Reflection
        How its walls reflect.
    stand_s : float
        How long the robot stands, s.
    look : callable
        Called with perception and the number of minutes stood, from 0 on.
    settle_s : float
        Time from the stop until what is sure counts as known, s. At the stop the last readings are not refined yet.
    """
    acoustics, ring = acoustics_of(model, seed), ring_of_room(seed)
    perception = Perception(ring, settings.models, settings.perception)
    known, lost, named = list[DetectedObject](), dict[int, int](), set[tuple[int, str]]()
    minute = -1
    for firing in Wandering(ring, seed, DRIVE_S, stand_s, acoustics=acoustics).firings():
        if firing.robot_s > DRIVE_S + settle_s + 60.0 * (minute + 1):
            minute += 1
            now = sure(perception)
            known = now if minute == 0 else known
            for k in (k for k, one in enumerate(known) if k not in lost and moved_m(one, now) > NEAR_M):
                lost[k] = minute
            look(perception, minute)
        perception.observe(firing)
        while perception.can_refine and perception.refine():
            pass
        named |= {(one.sensor, one.fault) for one in perception.sensor_reports()}
    now, world = sure(perception), furnished_room(seed, acoustics).world
    away = [moved_m(one, now) for one in known]
    lost |= {k: minute + 1 for k, m in enumerate(away) if k not in lost and m > NEAR_M}
    return StandTrial(
        known,
        [(known[k], at) for k, at in lost.items()],
        [(one, m) for k, (one, m) in enumerate(zip(known, away, strict=True)) if k not in lost and m > MOVED_M],
        [one for one in known if not is_true(one, world)],
        [one for one in now if moved_m(one, known) > NEAR_M and not is_true(one, world)],
        named,
    )


def measure(
    settings: Settings, seeds: Iterable[int], minutes: float, report: Callable[[str], None]
) -> dict[str, Row]:  # fmt: skip
    """Return the counts by reflection and kind of object.

    Parameters
    ----------
    settings
        Models and perception.
    seeds
        Which random rooms.
    minutes
        How long the robot stands in each, min.
    report
        Called with a line on what is running.
    """
    rows: dict[str, Row] = {}
    seeds = tuple(seeds)
    for model in get_args(Reflection):
        trials = []
        for seed in seeds:
            report(f"standing: {model}, room {seed}")
            trials.append(try_standing(settings, seed, model, 60.0 * minutes))
        for kind in KINDS:
            of = [trial.of(kind) for trial in trials]
            rows[f"{model}: {kind}"] = {name: sum(one[name] for one in of) for name in of[0]}
        rows[f"{model}: sensors"] = {"falsely named": sum(len(trial.named) for trial in trials)}
    return rows
