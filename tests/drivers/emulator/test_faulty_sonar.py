"""Lies of a ring: what each kind makes the sensors report, on the ring alone and through each family's protocol."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, get_args

import numpy as np
import pytest

from config.robot import RingConfig
from config.world import AcousticsConfig, WorldConfig
from drivers.contract.family import ROOM, Family
from drivers.emulator.fault_schedule import FaultSchedule
from drivers.emulator.faults import Fault
from drivers.emulator.faulty_sonar import KINDS, FaultySonar
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.messages import Pose
from tests.drivers.contract.families import ARCOS, DENNING, RFLEX, ROS2
from tests.drivers.device_host import script
from tests.drivers.emulator.one_sensor import wall
from tests.promises import ROOT

RING = RingConfig(
    count=4, radius_m=0.1, beam_half_angle_deg=12.0, resolution_m=0.002, range_min_m=0.02, range_max_m=5.0
)
"""Sensors that look forward, left, back and right, m from walls in these directions: 2, 1, 3, and none."""
WORLD = WorldConfig(wall=(wall(2.1, -9.0, 2.1, 9.0), wall(-9.0, 1.1, 9.0, 1.1), wall(-3.1, -9.0, -3.1, 9.0)))
STEP_S = 0.1
WINDOW_M = 4.0


class Bench:
    """A ring that is moved forward by 1 cm a firing, and the faults that come and go meanwhile."""

    def __init__(self, *faults: Fault) -> None:
        self.schedule = FaultSchedule(faults)
        sonar = Sonar(RING, compile_scene(WORLD), AcousticsConfig(), np.random.default_rng(1))
        self.ring = FaultySonar(sonar, 4, self.schedule, np.random.default_rng(2))
        self.steps = 0

    def fire(self, sensors: Sequence[int] = range(4)) -> list[float | None]:
        at_us = round(1e6 * STEP_S * self.steps)
        for begins, fault in self.schedule.due(at_us):
            self.schedule.set_active(fault, on=begins)
        self.steps += 1
        ranges = self.ring.fire(at_us, Pose(0.01 * (self.steps - 1), 0.0, 0.0), 0.0, sensors, WINDOW_M)
        return [None if range_m is None else round(range_m, 6) for range_m in ranges]


def lie(kind: str, **values: Any) -> Fault:
    (fault,) = script(**{"kind": kind, "at_s": 0.2, "duration_s": 0.5, **values})
    return fault


def lies(kind: str, count: int = 5, **values: Any) -> list[list[float | None]]:
    """Return what is reported from the beginning of a lie on, after two honest firings; it lasts for five."""
    bench = Bench(lie(kind, **values))
    assert [bench.fire() for _ in range(2)] == [[2.0, 1.0, 3.0, math.inf], [1.99, 1.0, 3.01, math.inf]]
    return [bench.fire() for _ in range(count)]


def test_a_frozen_ring_repeats_its_last_ranges_and_thaws() -> None:
    frozen = lies("frozen_ring", 6)
    assert frozen[:5] == 5 * [[1.99, 1.0, 3.01, math.inf]]
    assert frozen[5] == [1.93, 1.0, 3.07, math.inf]
    assert lies("frozen_ring", 3, sensors=[2])[-1] == [1.96, 1.0, 3.01, math.inf]


def test_sensors_that_have_not_fired_when_they_freeze_repeat_their_first_range() -> None:
    bench = Bench(lie("frozen_ring", at_s=0.0))
    assert [bench.fire([0]), bench.fire([2]), bench.fire([0]), bench.fire([2])] == [[2.0], [3.01], [2.0], [3.01]]


def test_echoes_are_replayed_from_the_beginning_of_the_period() -> None:
    assert [ranges[0] for ranges in lies("replayed_echoes", period_s=0.2)] == [2.0, 1.99, 2.0, 1.99, 2.0]


def test_frozen_ranges_may_tremble() -> None:
    frozen = lies("frozen_ring", 4, jitter_m=0.001)
    ahead = [ranges[0] for ranges in frozen if ranges[0] is not None]
    assert len(set(ahead)) == 4
    assert all(abs(range_m - 1.99) <= 0.001 for range_m in ahead)


def test_late_and_coarse_echoes() -> None:
    assert [ranges[0] for ranges in lies("delayed_echoes", 3, delay_s=0.2)] == [2.0, 1.99, 1.98]
    assert lies("coarse_ranges", 1, step_m=0.25) == [[2.0, 1.0, 3.0, math.inf]]
    assert lies("coarse_ranges", 1, step_m=0.5, sensors=[2]) == [[1.98, 1.0, 3.0, math.inf]]


def test_every_second_firing_may_be_silent() -> None:
    ahead = [ranges[0] for ranges in lies("silent_ring", 4, every=2)]
    assert ahead in ([math.inf, 1.97, math.inf, 1.95], [1.98, math.inf, 1.96, math.inf])


def test_silent_constant_and_blind_sensors() -> None:
    silence = math.inf
    assert lies("silent_ring", 1) == [4 * [silence]]
    assert lies("silent_ring", 1, sensors=[1]) == [[1.98, silence, 3.02, silence]]
    assert lies("constant_ring", 1, range_m=0.9) == [4 * [0.9]]
    assert lies("blind_near", 1, range_m=1.98) == [[1.98, silence, 3.02, silence]]
    assert lies("blind_near", 1, range_m=2.0, sensors=[0]) == [[silence, 1.0, 3.02, silence]]


@pytest.mark.parametrize(("offset_m", "ranges"), [
    (0.5, [2.48, 1.5, 3.52, math.inf]), (-0.5, [1.48, 0.5, 2.52, math.inf]), (-1.5, [0.48, 0.0, 1.52, math.inf]),
    (1.0, [2.98, 2.0, math.inf, math.inf]),
])  # fmt: skip
def test_an_offset_keeps_to_the_window(offset_m: float, ranges: list[float]) -> None:
    assert lies("range_offset", 1, offset_m=offset_m) == [ranges]


def test_a_share_of_the_readings_is_dropped() -> None:
    missing = lies("dropped_readings", 5, share=0.5)
    assert {ranges[1] for ranges in missing} == {None, 1.0}
    assert lies("reported_silence", 1, range_m=4.0) == [[1.98, 1.0, 3.02, 4.0]]
    silent = lies("dropped_readings", 5, share=0.5, silent=True)
    assert {ranges[1] for ranges in silent} == {math.inf, 1.0}
    assert lies("dropped_readings", 1, share=1.0) == [4 * [None]]
    assert lies("outliers", 1, share=1.0)[0] != [1.98, 1.0, 3.02, math.inf]


def test_a_turned_ring_and_swapped_sensors_hear_what_others_should() -> None:
    assert lies("turned_ring", 1, angle_deg=90.0) == [[1.0, 3.02, math.inf, 1.98]]
    assert lies("turned_ring", 1, sensors=[3], angle_deg=180.0) == [[1.98, 1.0, 3.02, 1.2]]
    assert lies("swapped_sensors", 1, first=0, second=2) == [[3.02, 1.0, 1.98, math.inf]]
    bench = Bench(lie("swapped_sensors", at_s=0.0, first=0, second=2))
    assert bench.fire([2, 1]) == [2.0, 1.0]


# Through the protocols.


BEGIN_S = 4.0
FAMILIES = {"arcos": ARCOS, "denning": DENNING, "rflex": RFLEX, "ros2": ROS2}


@pytest.fixture(params=FAMILIES)
def family(request: pytest.FixtureRequest) -> Family:
    return FAMILIES[request.param]


def heard(family: Family, kind: str, **values: Any) -> Iterator[tuple[int, list[float]]]:
    """Yield each sensor with the ranges that it reports half a second into a lie, while the robot drives."""
    ring = family.driving(None, lie(kind, at_s=BEGIN_S, duration_s=99.0, **values), world=ROOM)
    ring.run(BEGIN_S - ring.now_s)
    ring.run(0.5)
    ring.firings.clear()
    ring.run(1.5)
    table = np.array([firing.ranges_m for firing in ring.firings])
    for sensor, column in enumerate(table.T):
        yield sensor, column[~np.isnan(column)].tolist()


@pytest.mark.compiled
def test_each_family_reports_the_lies_of_its_sensors(family: Family) -> None:
    assert {len(set(ranges)) for _, ranges in heard(family, "frozen_ring")} == {1}
    assert {range_m for _, ranges in heard(family, "silent_ring") for range_m in ranges} == {math.inf}
    constant = {round(range_m, 1) for _, ranges in heard(family, "constant_ring") for range_m in ranges}
    assert constant == {0.9}
    assert all(not ranges for _, ranges in heard(family, "dropped_readings", share=1.0))


def test_a_latched_clock_stamps_everything_alike() -> None:
    clock = FaultSchedule(script(kind="clock_error", at_s=1.0, duration_s=2.0))
    assert [clock.clock_us(us) for us in (0, 1_000_000, 2_000_000, 3_500_000)] == [0, 1_000_000, 1_000_000, 1_500_000]
    slow = FaultSchedule(script(kind="clock_error", at_s=1.0, duration_s=9.0, rate=0.5, leap_s=3.0))
    assert [slow.clock_us(us) for us in (999_999, 1_000_000, 2_000_000)] == [999_999, 4_000_000, 4_500_000]
    steps = FaultSchedule(script(kind="clock_error", at_s=1.0, duration_s=2.0, rate=1.0, step_s=0.5))
    stamps = [steps.clock_us(us) for us in (900_000, 1_300_000, 1_600_000, 3_100_000)]
    assert stamps == [900_000, 1_000_000, 1_500_000, 3_100_000]
    for family in (DENNING, RFLEX, ROS2):
        cable = family.driving(None, lie("clock_error", at_s=BEGIN_S, duration_s=99.0))
        cable.run(BEGIN_S - cable.now_s + 0.1)
        cable.odometry.clear()
        cable.run(0.3)
        assert len({sample.robot_s for sample in cable.odometry}) <= 1


@pytest.mark.parametrize("factor", [0.0, -1.0])
def test_the_odometry_counts_by_a_factor(family: Family, factor: float) -> None:
    cable = family.driving(None, lie("odometry_error", at_s=BEGIN_S, duration_s=9.0, factor=factor))
    cable.run(BEGIN_S - cable.now_s + 0.2)
    reported, true = cable.odometry[-1].pose.x, cable.robot.truth.pose.x
    cable.run(1.0)
    way = cable.robot.truth.pose.x - true
    assert way > 0.1
    assert cable.odometry[-1].pose.x - reported == pytest.approx(factor * way, abs=0.05)


def test_a_drum_appears_ahead_and_stops_the_body(family: Family) -> None:
    drum = lie("sudden_object", at_s=BEGIN_S, duration_s=2.0, distance_m=0.2, radius_m=0.1)
    cable = family.driving(None, drum)
    cable.run(BEGIN_S - cable.now_s - 0.01)
    here, contacts = cable.robot.truth.pose.x, cable.robot.truth.contacts
    assert (contacts, cable.robot.truth.contact_m_s) == (0, 0.0)
    cable.run(1.5)
    assert cable.robot.truth.pose.x - here == pytest.approx(0.2, abs=0.01)
    assert cable.robot.truth.contacts > 0
    assert cable.robot.truth.contact_m_s == pytest.approx(0.3, abs=0.03)


def test_every_lie_is_documented() -> None:
    page = ROOT.joinpath("docs", "extending.md").read_text(encoding="utf-8")
    named = [get_args(kind.model_fields["kind"].annotation)[0] for kind in KINDS]
    assert [
        name for name in (*named, "clock_error", "odometry_error", "sudden_object") if f"| `{name}` |" not in page
    ] == []
