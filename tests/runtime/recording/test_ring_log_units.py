"""Ring logs in other units than metres, radians and seconds are refused with the unit; others pass unchanged."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from config.load import load_settings
from drivers.messages import Firing, Pose
from runtime.recording.ring_log import RingLogError
from runtime.recording.ring_log_units import FIRST, plausible_firings

ROBOT = load_settings("hallway")
LOG = Path("log.csv")
HALF_S = 3.0


def drive(count: int = 300, turn: float = 0.2, heading: float = 0.4) -> Iterator[Firing]:
    """Yield a drive along an arc at 0.2 m/s, with an eighth of the ring firing at a time."""
    rng, dt = np.random.default_rng(1), 0.05
    x, y, theta = 0.0, 0.0, heading
    for k in range(count):
        ranges = np.full(24, np.nan)
        ranges[k % 8 :: 8] = rng.uniform(0.3, 7.0, 3)
        ranges[(k + 8) % 24 if k % 3 else k % 24] = np.inf
        yield Firing(dt * k, Pose(x, y, theta), theta, ranges)
        x, y = x + 0.2 * dt * math.cos(theta), y + 0.2 * dt * math.sin(theta)
        theta += turn * dt


def in_units(firing: Firing, *, t: float = 1.0, place: float = 1.0, angle: float = 1.0, reach: float = 1.0) -> Firing:
    """Return a firing whose numbers are multiplied."""
    pose = Pose(place * firing.pose.x, place * firing.pose.y, angle * firing.pose.theta)
    return Firing(t * firing.robot_s, pose, angle * firing.ring_yaw, reach * firing.ranges_m)


def turns_on_the_spot(firing: Firing) -> Firing:
    return replace(firing, pose=Pose(0.0, 0.0, 3.0 * firing.pose.theta))


def straight_first(firing: Firing) -> Firing:
    """Return a firing of a drive whose first half leads along x, where degrees and radians are the same."""
    along = 0.2 * min(firing.robot_s, HALF_S)
    if firing.robot_s <= HALF_S:
        return replace(firing, pose=Pose(along, 0.0, 0.0), ring_yaw=0.0)
    angle = 0.2 * (firing.robot_s - HALF_S)  # an arc of a radius of 1 m
    return replace(firing, pose=Pose(along + math.sin(angle), 1.0 - math.cos(angle), angle), ring_yaw=angle)


@pytest.mark.parametrize("count", [1, 50, 300, FIRST + 7])
def test_a_log_in_metres_and_radians_passes_unchanged(count: int) -> None:
    given, said = list(drive(count)), list[str]()
    assert list(plausible_firings(iter(given), LOG, ROBOT, said.append)) == given
    for change in (
        turns_on_the_spot,
        straight_first,
        lambda f: in_units(f, place=0.0),
        lambda f: in_units(f, place=-1.0),
    ):
        changed = [change(firing) for firing in given]
        assert list(plausible_firings(changed, LOG, ROBOT, said.append)) == changed, "on the spot, or backwards"
    assert not said


def test_leaps_of_the_odometry_are_no_unit() -> None:
    leaps = [replace(f, pose=replace(f.pose, x=f.pose.x + 40.0 * (k // 60))) for k, f in enumerate(drive())]
    assert list(plausible_firings(leaps, LOG, ROBOT)) == leaps


@pytest.mark.parametrize("count", [120, FIRST + 50])
@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda f: in_units(f, reach=1e3), "ranges are in metres; say --range-unit mm if they are in mm"),
        (lambda f: in_units(f, reach=100.0), "say --range-unit cm if"),
        (lambda f: in_units(f, reach=1.0 / 0.3048), "say --range-unit ft if"),
        (lambda f: in_units(f, place=1e3), "positions are in metres"),
        (lambda f: in_units(f, place=1e3, reach=1e3, angle=180.0 / math.pi), "ranges are in metres"),
        (lambda f: in_units(f, angle=180.0 / math.pi), "theta is in degrees"),
        (lambda f: in_units(straight_first(f), angle=180.0 / math.pi), "theta is in degrees"),
        (lambda f: in_units(turns_on_the_spot(f), angle=180.0 / math.pi), "theta turns at"),
        (lambda f: in_units(f, t=1e3), "t is in seconds"),
    ],
    ids=["mm", "cm", "ft", "mm-places", "all", "degrees", "degrees-after-a-straight", "degrees-on-the-spot", "ms"],
)
def test_a_log_in_other_units_is_refused(change: Callable[[Firing], Firing], said: str, count: int) -> None:
    with pytest.raises(RingLogError, match=said) as refused:
        list(plausible_firings(map(change, drive(count)), LOG, ROBOT))
    assert refused.value.exit_code == 2
    assert str(LOG) in str(refused.value)


def test_ranges_at_the_window_are_said() -> None:
    said = list[str]()
    window = [replace(f, ranges_m=np.where(np.isinf(f.ranges_m) | (f.ranges_m > 3.0), 7.7724, f.ranges_m))
              for f in drive()]  # fmt: skip
    assert list(plausible_firings(window, LOG, ROBOT, said.append)) == window
    (text,) = said
    assert "exactly 7.7724: where that stands for no echo, say --silence 7.7724" in text
