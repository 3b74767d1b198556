"""A place that the operator names: a right one is kept, a wrong one is refuted, and the robot is found."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from bench.trials.furnished_rooms import ACOUSTICS, furnished_room
from bench.trials.known_room_trials import (
    RIGHT_M,
    RIGHT_RAD,
    SURE,
    KnownDrive,
    furnished_drive,
    heard_on_the_way,
)
from config.load import load_settings
from config.robot import RingConfig
from config.world import WorldConfig
from drivers.messages import Firing, Pose, wrap_angle
from perception.localization.known_room.known_room import KnownRoom
from perception.localization.room.room import room_of
from perception.snapshot import Snapshot, put_back, snapshot_of
from tests.perception.localization.rooms import RECTANGLE, RING, world_of

pytestmark = pytest.mark.compiled

RINGS = {"denning": RING, "p3at": load_settings("hallway", ["robot=p3at"]).ring}
ERRORS = {"right": (0.0, 0.0), "near": (0.2, 5.0), "1 m": (1.0, 0.0), "3 m": (3.0, 0.0), "90°": (0.0, 90.0),
          "180°": (0.0, 180.0)}  # fmt: skip
"""Of the named place, m and degrees."""


@dataclass(slots=True)
class Outcome:
    """What was said after the place was named: while the robot stood, and on its way from there."""

    stands: list[tuple[str, bool]]
    drives: list[tuple[str, bool]]
    """Status, and whether the place was right."""
    refuted: int

    @property
    def is_wrong(self) -> bool:
        """Whether a wrong place was tracked."""
        return any(status == "tracking" and not right for status, right in self.stands + self.drives)


def hear(localizer: KnownRoom, firing: Firing) -> None:
    localizer.observe(firing)
    while localizer.can_refine:
        localizer.refine()


def named(
    ring: RingConfig,
    world: WorldConfig,
    drive: KnownDrive,
    seed: int,
    error: tuple[float, float],
    at: int,
    before: Snapshot,
) -> Outcome:
    """Stand, name a place in error (m, °), stand on while each sensor fires three times, and drive on.

    `before` is what was known after the firing number `at`.
    """
    localizer, rng = KnownRoom(room_of(world), ring), np.random.default_rng(seed)
    put_back(localizer, before)
    localizer.drop_caches()
    rows = list(zip(drive.firings, drive.truth.tolist(), strict=True))

    def said(firing: Firing, truth: list[float]) -> tuple[str, bool]:
        hear(localizer, firing)
        here = localizer.localized()
        off = math.dist((here.pose.x, here.pose.y), truth[:2])
        right = off < RIGHT_M and abs(wrap_angle(here.ring_yaw - truth[2])) < RIGHT_RAD
        status = here.status if here.status != "tracking" or here.probability > SURE else "localizing"
        return status, right

    firing, truth = rows[at]
    away_m, turn_deg, way = *error, rng.uniform(-math.pi, math.pi)
    x, y = truth[0] + away_m * math.cos(way), truth[1] + away_m * math.sin(way)
    localizer.assume(Pose(x, y, truth[2] + math.radians(turn_deg) + firing.pose.theta - firing.ring_yaw))
    standing = heard_on_the_way(ring, world, np.array([truth] * (3 * len(ring.mounts))), seed + 1)
    stands = [
        said(Firing(firing.robot_s, firing.pose, firing.ring_yaw, heard.ranges_m), truth)
        for heard in standing.firings
    ]
    return Outcome(stands, [said(*row) for row in rows[at:]], localizer.refuted)


SIXTEEN = range(8300, 8316)


@pytest.mark.parametrize(
    ("robot", "before_m", "seeds"),
    [
        ("denning", 3.0, range(8200, 8201)), pytest.param("p3at", 0.0, range(8200, 8201), marks=pytest.mark.soak),
        *(pytest.param(robot, way_m, SIXTEEN, marks=pytest.mark.soak) for robot in RINGS for way_m in (0.0, 3.0)),
    ],
)  # fmt: skip
def test_a_wrong_place_is_refuted_and_a_right_one_is_never_lost(
    robot: str, before_m: float, seeds: range, measured: Callable[[str], None]
) -> None:
    """Over rooms, reflections and errors; a robot that stands finds itself where it could at the start."""
    found, lost, wrong, cases, firings = 0, 0, 0, 0, 0
    for seed in seeds:
        for reflection in ("cone", "specular"):
            acoustics = ACOUSTICS.model_copy(update={"model": reflection})
            drive = furnished_drive(RINGS[robot], seed, acoustics, length_m=before_m + 3.0)
            world = furnished_room(seed, acoustics).world
            localizer, at = KnownRoom(room_of(world), RINGS[robot]), int(np.searchsorted(drive.way_m(), before_m))
            for firing in drive.firings[: at + 1]:
                hear(localizer, firing)
            before = snapshot_of(localizer)
            for name, error in ERRORS.items():
                outcome = named(RINGS[robot], world, drive, seed, error, at, before)
                cases, wrong = cases + 1, wrong + outcome.is_wrong
                found += outcome.drives[-1] == ("tracking", True)
                if name in {"right", "near"}:
                    every = outcome.stands + outcome.drives
                    firings, lost = firings + len(every), lost + sum(status == "lost" for status, _ in every)
                    assert outcome.refuted == 0
    measured(
        f"{robot}: {found} of {cases} found, {wrong} tracked a wrong place; right places lost {lost} of {firings}"
    )
    assert lost == 0
    assert wrong <= cases // 20
    assert found >= 0.95 * cases


@pytest.mark.parametrize("was_known", [False, True])
def test_a_robot_that_was_carried_and_misnamed_is_found(was_known: bool) -> None:
    """The readings before it was carried lead to a place that those since refute."""
    world = furnished_room(2001).world
    here = furnished_drive(RING, 2001, standing=True).truth[0].tolist()
    there = [-0.5 * here[0], -0.5 * here[1], here[2] + 1.0]
    standing = heard_on_the_way(RING, world, np.array([there] * (60 if was_known else 0) + [here] * 60), 5)
    localizer, at = KnownRoom(room_of(world), RING), Pose(2.0, 1.0, 0.3)
    for k, firing in enumerate(standing.firings):
        localizer.observe(Firing(0.0, at, at.theta, firing.ranges_m))
        if k == len(standing.firings) - 60:
            localizer.assume(Pose(here[0] + 0.7, here[1] - 0.7, here[2] + 2.0))
        while localizer.can_refine:
            localizer.refine()
    pose = localizer.localized().pose
    assert (localizer.status, localizer.refuted) == ("tracking", 1)
    assert math.dist((pose.x, pose.y), here[:2]) < 0.1


@pytest.mark.parametrize("is_mirrored", [False, True])
def test_a_room_that_is_ambiguous_is_called_so(is_mirrored: bool) -> None:
    """A rectangle looks the same from two places; the operator decides, and the log says that the readings do not."""
    world, steps = world_of(RECTANGLE, ACOUSTICS), np.arange(0.0, 2.4, 0.05)
    truth = np.column_stack([1.2 + steps, 1.1 + 0.2 * steps, np.full(len(steps), 0.3)])
    drive = heard_on_the_way(RING, world, truth, 3)
    localizer = KnownRoom(room_of(world), RING)

    def said(row: list[float]) -> Pose:
        x, y, theta = row
        return Pose(5.0 - x, 3.0 - y, theta + math.pi) if is_mirrored else Pose(x, y, theta)

    for k, (firing, row) in enumerate(zip(drive.firings, truth.tolist(), strict=True)):
        localizer.observe(firing)
        while localizer.can_refine:
            localizer.refine()
        if k == 24:
            assert (localizer.status, localizer.rivals) == ("localizing", 1)
            named_pose = said(row)
            turn = firing.pose.theta - firing.ring_yaw
            localizer.assume(Pose(named_pose.x, named_pose.y, named_pose.theta + turn))
    pose, right = localizer.localized().pose, said(truth[-1].tolist())
    assert (localizer.status, localizer.refuted, localizer.rivals) == ("tracking", 0, 1)
    assert math.dist((pose.x, pose.y), (right.x, right.y)) < 0.1
