"""Sensors that turn with the wheels: a ring of such is a ring that turns, and two rings are each as if alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from config.load import load_settings
from config.robot import RingConfig
from config.settings import Settings
from config.world import WorldConfig
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.messages import Firing, Pose
from perception.localization.drumheller.panorama import panoramas
from perception.localization.known_room.keyframes import Keyframes
from perception.pipeline import Perception
from perception.sensor_mounts import mounts_array, turned_mounts

pytestmark = pytest.mark.compiled

UPPER, BASE = (load_settings(None, (), robot=name) for name in ("b21r", "b21r-base"))
BASE_YAW = 0.4
"""The direction in which the base stands, rad."""


def with_turning(ring: RingConfig) -> RingConfig:
    assert ring.sensors is not None
    sensors = [sensor.model_copy(update={"turns_with_wheels": True}) for sensor in ring.sensors]
    return ring.model_copy(update={"sensors": tuple(sensors)})


def firings(settings: Settings, *, yaw: float | None) -> list[Firing]:
    """Return the firings of a bent drive down the hall; the ring's direction is `yaw`, or that of the wheels."""
    world = settings.world
    assert world is not None
    sonar = Sonar(settings.ring, compile_scene(world), world.acoustics, np.random.default_rng(1))
    sets = settings.ring.firing.sets
    assert sets is not None
    done = []
    for k in range(240):
        pose = Pose(world.start.x_m + 0.02 * k, world.start.y_m + 0.3 * math.sin(0.01 * k), 0.5 * math.sin(0.03 * k))
        ring_yaw = pose.theta if yaw is None else yaw
        done.append(Firing(0.03 * k, pose, ring_yaw, sonar.fire(pose, ring_yaw, sets[k % len(sets)])))
    return done


def seen(settings: Settings, drive: Sequence[Firing]) -> Perception:
    perception = Perception(settings.ring, settings.models, settings.perception)
    for firing in drive:
        perception.observe(firing)
        for _ in range(20):
            if not perception.can_refine:
                break
            perception.refine()
    # The last ones are named once all that they might be was compared with them.
    silent = np.full(len(settings.ring.mounts), np.nan)
    for k in range(24):
        perception.observe(replace(drive[-1], robot_s=drive[-1].robot_s + 0.03 * k, ranges_m=silent))
        while perception.can_refine and perception.refine():
            pass
    return perception


@pytest.mark.parametrize("extra", [(), ("perception.method=paper",), ("perception.localization.correct_drift=true",)])
def test_a_ring_of_which_every_sensor_turns_is_a_ring_that_turns(extra: tuple[str, ...]) -> None:
    settings = load_settings(None, extra, robot="b21r")
    drive = firings(settings, yaw=None)
    expected = seen(settings, drive)
    got = seen(
        settings.model_copy(update={"ring": with_turning(settings.ring)}),
        [replace(firing, ring_yaw=BASE_YAW) for firing in drive],
    )
    assert len(got.objects()) == len(expected.objects()) > 0
    # The filter of the drift has another model of a ring that keeps its direction; all else is the same.
    tolerance_m = 0.02 if settings.perception.localization.correct_drift else 1e-6
    by_place = [sorted(run.objects(), key=lambda found: (round(found.x, 1), found.y)) for run in (got, expected)]
    for found, known in zip(*by_place, strict=True):
        assert (found.x, found.y) == pytest.approx((known.x, known.y), abs=tolerance_m)
    last = drive[-1]
    mine = got.surroundings(last.robot_s, BASE_YAW, last.pose, 1.0)[0]
    known_view = expected.surroundings(last.robot_s, last.pose.theta, last.pose, 1.0)[0]
    assert mine.axes_rad == pytest.approx(known_view.axes_rad, abs=1e-12)
    assert mine.bearings_rad == pytest.approx(known_view.bearings_rad, abs=1e-9)
    assert got.sensor_reports() == expected.sensor_reports()


def test_both_rings_hear_what_each_hears_alone() -> None:
    both = load_settings(None, (), robot="b21r-both")
    world = both.world
    assert world is not None
    here, yaw = Pose(world.start.x_m, world.start.y_m, 0.7), 0.1

    def heard(ring: RingConfig, ring_yaw: float, around: WorldConfig) -> Any:
        sonar = Sonar(ring, compile_scene(around), around.acoustics, np.random.default_rng(1))
        return sonar.fire(here, ring_yaw).tolist()

    alone = heard(UPPER.ring, here.theta, world) + heard(BASE.ring, yaw, world)
    assert heard(both.ring, yaw, world) == pytest.approx(alone, abs=1e-3)
    assert sum(math.isfinite(range_m) for range_m in alone) > 10


def test_keyframes_and_panoramas_place_the_readings_of_a_turned_part() -> None:
    turning, heading = with_turning(UPPER.ring), 0.5
    drive = [
        replace(firing, pose=Pose(firing.pose.x, firing.pose.y, heading), ring_yaw=heading)
        for firing in firings(UPPER, yaw=None)[:40]
    ]
    stands = [replace(firing, ring_yaw=BASE_YAW) for firing in drive]
    expected, got = (
        Keyframes(mounts_array(UPPER.ring.mounts)),
        Keyframes(mounts_array(turning.mounts), turning.turning),
    )
    for firing, standing in zip(drive, stands, strict=True):
        assert expected.observe(firing) == got.observe(standing)
    assert expected.count > 2
    off = Pose(0.0, 0.0, heading - BASE_YAW)
    for row in range(expected.count):
        count = expected.counts[row]
        assert got.counts[row] == count
        for known, found in zip(expected.readings[row, :count], got.readings[row, :count], strict=True):
            placed = off.compose(Pose(known[0], known[1], math.atan2(known[3], known[2])))
            turned = [placed.x, placed.y, math.cos(placed.theta), math.sin(placed.theta), known[-1]]
            assert found[[0, 1, 2, 3, -1]] == pytest.approx(turned, abs=1e-12)
    first, second = panoramas(drive, UPPER.ring)[0], panoramas(stands, turning)[0]
    for x, y, axis, at_x, at_y, at_axis in zip(
        first.x, first.y, first.axis, second.x, second.y, second.axis, strict=True
    ):
        if not math.isnan(x):
            placed = off.compose(Pose(x, y, axis))
            assert (placed.x, placed.y) == pytest.approx((at_x, at_y), abs=1e-12)
            assert math.remainder(placed.theta - at_axis, math.tau) == pytest.approx(0.0, abs=1e-12)


def test_mounts_turn_about_the_centre_and_are_the_same_array_where_none_turns() -> None:
    mounts = mounts_array(UPPER.ring.mounts)
    assert turned_mounts(mounts, (), 1.0) is mounts
    turned = turned_mounts(mounts, (2, 5), 1.0)
    for i, (x, y, axis) in enumerate(mounts.tolist()):
        expected = Pose(0.0, 0.0, 1.0 if i in {2, 5} else 0.0).compose(Pose(x, y, axis))
        assert turned[i] == pytest.approx([expected.x, expected.y, expected.theta], abs=1e-15)
