"""Poses of other moments than those of the ranges: taken into account where the echoes show it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from config.errors import UserError
from config.load import load_settings
from drivers.messages import Firing, Pose
from runtime.recording.conventions.echo_lag import at_heard_poses
from runtime.recording.conventions.options import RingLogOptions
from runtime.recording.conventions.reading import converted_firings
from tests.perception.localization.submaps.test_echo_lag import lagging

DENNING = load_settings(None, robot="denning")


def moving() -> Iterator[Firing]:
    """Yield firings of a robot that drives and turns."""
    for k in range(12):
        yield Firing(0.1 * k, Pose(0.1 * k, 0.0, 3.1 + 0.02 * k), 3.1 + 0.02 * k, np.full(24, 1.0 + 0.1 * k))


@pytest.mark.parametrize("lag_s", [0.25, 0.1, -0.05, -0.3])
def test_each_firing_has_the_pose_of_another_moment(lag_s: float) -> None:
    got, asked = list(at_heard_poses(moving(), lag_s)), list(moving())
    assert [one.robot_s for one in got] == [one.robot_s for one in asked]
    assert [one.ranges_m[0] for one in got] == [one.ranges_m[0] for one in asked]
    at = np.clip([one.robot_s - lag_s for one in asked], 0.0, 1.1)
    assert [one.pose.x for one in got] == pytest.approx(at.tolist())
    assert [one.ring_yaw for one in got] == pytest.approx((3.1 + 0.2 * at).tolist())


def test_no_lag_leaves_a_log_alone() -> None:
    firings = list(moving())
    assert all(a is b for a, b in zip(at_heard_poses(firings, 0.0), firings, strict=True))


@pytest.mark.compiled
def test_a_lag_is_found_said_and_taken_into_account() -> None:
    said: list[str] = []
    firings = lagging(0.2)
    exact = lagging(0.0)
    got = list(converted_firings(firings, Path("log.csv"), DENNING, RingLogOptions(), said.append))
    off = [abs(a.pose.theta - b.pose.theta) for a, b in zip(got, exact, strict=True)]
    raw = [abs(a.pose.theta - b.pose.theta) for a, b in zip(firings, exact, strict=True)]
    assert np.mean(off) < 0.2 * np.mean(raw)
    (text,) = said
    assert "the ranges lag behind odometry by 0.2" in text
    assert "--echo-lag 0.2" in text


def test_the_option_settles_it() -> None:
    said: list[str] = []
    options = RingLogOptions(echo_lag="0.1")
    got = list(converted_firings(list(moving()), Path("log.csv"), DENNING, options, said.append))
    assert got[5].pose.x == pytest.approx(0.4)
    assert said == []


@pytest.mark.parametrize("text", ["1", "-0.5", "soon", "nan"])
def test_an_impossible_lag_is_refused(text: str) -> None:
    with pytest.raises(UserError, match="--echo-lag"):
        RingLogOptions(echo_lag=text).check()
