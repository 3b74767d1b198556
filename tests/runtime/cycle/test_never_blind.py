"""P24: the robot moves only towards directions that the ring has looked in lately, judged by the emulator's truth."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence

import numpy as np
import pytest

from behaviors.teleoperation import Teleoperate
from config.load import load_settings
from config.settings import Settings
from config.world import AcousticsConfig, DrumConfig, WallConfig, WorldConfig
from drivers.emulator.faults import Fault, Garbage, StuckSensor
from drivers.firing_pattern import FiringError
from drivers.messages import wrap_angle
from runtime.cycle.inputs import Request
from runtime.cycle.line_messages import FIRST_LOOK
from runtime.cycle.modes import Mode
from runtime.cycle.step import CycleRecord
from runtime.simulation.long_hall import long_hall
from runtime.support.pattern_check import refuse_undrivable
from tests.runtime.emulated_run import Run

pytestmark = [pytest.mark.promise("P24"), pytest.mark.compiled]

WALL_AHEAD = WorldConfig(wall=(WallConfig(x1_m=3.0, y1_m=-4.0, x2_m=3.0, y2_m=4.0),))
BLIND_S = 3.0
"""When the sensors begin to fail, s; by then the robot drives at its base velocity, 2 m from the wall."""
AHEAD = (21, 22, 23, 0, 1, 2, 3)
MOVING_M_S = 0.02
LATE_S = 0.15
"""Longest time from a firing to the velocity that follows from it: window, transmission, cycle."""


class WatchedRun(Run):
    """A run without recognition that records every usable range, and how it truly moved."""

    def __post_init__(self) -> None:
        self.preparing = "left out"
        super().__post_init__()
        self.looks: deque[tuple[float, float]] = deque(maxlen=2400)
        """Bearing and time of each usable range or silence."""
        self.oldest_s = 0.0
        """Largest age of a direction towards which the base moved."""
        self.way_m = 0.0
        self.velocity: Teleoperate | None = None
        """What an operator requests in every cycle."""

    def cycle(self, request: Request | None = None) -> CycleRecord:
        before = self.robot.truth.pose
        if self.velocity is not None:
            self.state.drive_request, self.state.requested_run_s = self.velocity, self.run_s
        record = super().cycle(request)
        for firing in record.inputs.received.firings:
            for sensor in np.flatnonzero(~np.isnan(firing.ranges_m)).tolist():
                self.looks.append((firing.ring_yaw + math.tau * sensor / 24, firing.robot_s))
        truth = self.robot.truth
        self.way_m += math.hypot(truth.pose.x - before.x, truth.pose.y - before.y)
        if abs(truth.twist.v) > MOVING_M_S:
            way = truth.pose.theta + (math.pi if truth.twist.v < 0.0 else 0.0)
            self.oldest_s = max(self.oldest_s, self.age_s(way))
        return record

    def age_s(self, way: float) -> float:
        """Return how long ago the worst direction of the body's path was looked in, degree by degree."""
        body, clearance_m = self.settings.body, self.settings.behaviors.arbiter.clearance_m
        half = math.floor(math.degrees(math.asin(body.radius_m / (body.radius_m + clearance_m))))
        unseen = {math.radians(degree) for degree in range(-half, half + 1)}
        beam = math.radians(self.settings.ring.beam_half_angle_deg) + 1e-3
        for bearing, looked_s in reversed(self.looks):
            unseen = {degree for degree in unseen if abs(wrap_angle(way + degree - bearing)) > beam}
            if not unseen:
                return self.robot.truth.emulated_s - looked_s
        return math.inf


def settings(*sets: str) -> Settings:
    return load_settings("hallway", ["behaviors.move_ahead.at_end=stop", *sets])


def failing(sensors: Sequence[int], at_s: float = BLIND_S) -> list[Fault]:
    """Return faults: sensors report no range from then on."""
    return [StuckSensor(kind="stuck_sensor", at_s=at_s, duration_s=1e3, sensor=i) for i in sensors]


def assert_safe(run: WatchedRun) -> None:
    age_max_s = run.settings.behaviors.avoid_static_obstacle.echo_age_max_s
    assert run.robot.truth.contacts == 0
    assert run.oldest_s <= age_max_s + LATE_S


@pytest.mark.parametrize(("sensors", "said"), [
    pytest.param(range(24), "the ring fires, but no sensor has given a usable range for", marks=pytest.mark.soak),
    (AHEAD, "the ring has not looked ahead for 3.0 s: no usable range from sensor 0, 1, 2, 3, 21, 22, 23;"),
    ([0], "the ring has not looked ahead for 3.0 s: no usable range from sensor 0;"),
], ids=["all", "ahead", "one"])  # fmt: skip
def test_it_slows_down_stands_and_names_the_sensors(
    sensors: Sequence[int], said: str, measured: Callable[[str], None]
) -> None:
    run = WatchedRun(settings(), WALL_AHEAD, 0, failing(sensors))
    run.until(BLIND_S)
    speed, place = run.robot.truth.twist.v, run.robot.truth.pose.x
    assert speed == pytest.approx(0.3, abs=0.01)
    run.until(12.0)
    assert_safe(run)
    assert run.state.mode.mode is Mode.SAFE_STOP
    assert said in str(run.state.mode.reason)
    assert str(run.state.mode.reason).endswith(", then re-arm")
    driven = run.robot.truth.pose.x - place
    assert driven < 0.5
    measured(f"{len(sensors)} sensors fail at 0.3 m/s: stands after {driven:.2f} m")


def reasons_until(run: WatchedRun, until_s: float) -> list[str]:
    """Return the reasons to hold up to a time, each once."""
    reasons = list[str]()
    while run.run_s < until_s:
        run.cycle()
        if (reason := run.state.hold_reason) is not None and reason not in reasons:
            reasons.append(reason)
    return reasons


@pytest.mark.parametrize(("sensors", "said"), [
    ((), [FIRST_LOOK]),
    ([0], [FIRST_LOOK, "the ring has not looked ahead yet: no usable range from sensor 0; check the ring's cables "
           "and what covers it, then re-arm"]),
], ids=["good", "sensor 0 is deaf"])  # fmt: skip
def test_a_ring_that_has_just_started_is_given_time_for_its_pattern(sensors: Sequence[int], said: list[str]) -> None:
    run = WatchedRun(settings(), WALL_AHEAD, 0, failing(sensors, 0.0))
    assert reasons_until(run, 1.0) == said
    if sensors:
        run.until(4.0)
        assert run.state.mode.mode is Mode.SAFE_STOP
        run.cycle(Request.ARM)
        assert reasons_until(run, 5.0) == said[1:], "it has fired for long, though this drive is new"


def test_an_operator_is_held_in_front_of_the_unseen_and_may_drive_back() -> None:
    run = WatchedRun(settings(), WALL_AHEAD, 0, failing(AHEAD))
    run.velocity = Teleoperate(0.5, 0.0)
    run.until(BLIND_S)
    assert run.robot.truth.twist.v > 0.4
    run.until(8.0)
    assert run.state.mode.mode is Mode.DRIVE
    assert str(run.state.hold_reason).startswith(
        "the ring has not looked ahead for 5.1 s: no usable range from sensor 0,"
    )
    there = run.robot.truth.pose.x
    assert run.robot.truth.twist.v == 0.0
    run.velocity = Teleoperate(-0.3, 0.0)
    run.until(10.0)
    assert run.state.hold_reason is None
    assert run.robot.truth.pose.x < there - 0.3
    assert_safe(run)


PATTERNS = {
    "single": 0.1, "opposite_pairs": 0.3, "thirds": 0.3, "quadrants": 0.3, "octets": 0.3, "alternating": 0.3,
}  # fmt: skip


@pytest.mark.parametrize(
    "preset",
    [pytest.param(one, marks=[] if one == "alternating" else [pytest.mark.soak]) for one in PATTERNS],
)
def test_every_preset_drives(preset: str) -> None:
    chosen = settings(f"ring.firing={preset}")
    refuse_undrivable(chosen)
    run = WatchedRun(chosen, WALL_AHEAD, 0)
    run.until(6.0)
    assert run.robot.truth.twist.v >= 0.99 * PATTERNS[preset]
    run.until(20.0)
    assert_safe(run)
    assert run.state.mode.mode is Mode.DRIVE
    assert run.robot.truth.pose.x > 1.3


@pytest.mark.parametrize("firing", [
    "{sets=[[9, 12, 15], [10, 13], [11, 14]]}",
    *(pytest.param(one, marks=pytest.mark.soak)
      for one in ("{preset='single', step_period_s=0.1}", "{sets=[[0]]}",
                  "{sets=[[0, 8, 16]], rotations=8, step_period_s=0.4}")),
])  # fmt: skip
def test_a_pattern_that_is_refused_could_not_drive_into_the_wall_either(firing: str) -> None:
    chosen = settings(f"ring.firing={firing}")
    with pytest.raises(FiringError, match=r"^ring\.firing: .* so that the robot could not drive"):
        refuse_undrivable(chosen)
    run = WatchedRun(chosen, WALL_AHEAD, 0)
    run.until(25.0)
    assert_safe(run)


def random_run(seed: int) -> WatchedRun:
    """Return a drive through a walled hall with drums, in which some sensors fail, for a while, at random moments."""
    rng = np.random.default_rng(seed)
    corners = [(-2.5, -2.5), (5.0, -2.5), (5.0, 2.5), (-2.5, 2.5)]
    walls = tuple(
        WallConfig(x1_m=x1, y1_m=y1, x2_m=x2, y2_m=y2)
        for (x1, y1), (x2, y2) in zip(corners, [*corners[1:], corners[0]], strict=True)
    )
    places = rng.uniform((1.2, -2.0), (4.5, 2.0), (4, 2)).tolist()
    drums = tuple(DrumConfig(x_m=x, y_m=y, radius_m=float(rng.uniform(0.15, 0.4))) for x, y in places)
    faults: list[Fault] = []
    for _ in range(int(rng.integers(1, 4))):
        first, count, at_s = int(rng.integers(24)), int(rng.integers(1, 13)), float(rng.uniform(0.0, 15.0))
        lasts_s = float(rng.uniform(0.3, 8.0))
        faults += [
            StuckSensor(kind="stuck_sensor", at_s=at_s, duration_s=lasts_s, sensor=(first + i) % 24)
            for i in range(count)
        ]
    if rng.random() < 0.5:
        faults.append(
            Garbage(kind="garbage", at_s=float(rng.uniform(0.0, 15.0)), duration_s=float(rng.uniform(0.2, 2.5)))
        )
    chosen = settings(
        f"ring.firing.preset={rng.choice(list(PATTERNS))}",
        f"behaviors.move_ahead.move_ahead_direction_deg={rng.uniform(-180.0, 180.0)}",
        f"body.synchro={'true' if rng.random() < 0.5 else 'false'}",
        f"behaviors.arbiter.base_velocity_m_s={rng.uniform(0.2, 0.5)}",
    )
    world = WorldConfig(wall=walls, drum=drums, acoustics=AcousticsConfig(noise_relative=0.01, dropout=0.02))
    return WatchedRun(chosen, world, seed, faults)


def drive_at_random(seeds: range) -> str:
    """Drive at random, re-armed after every stop; return the measurement."""
    oldest_s, way_m, stops = 0.0, 0.0, 0
    for seed in seeds:
        run = random_run(seed)
        for end_s in range(1, 26):
            run.until(float(end_s))
            if run.mode is Mode.SAFE_STOP:
                stops += 1
                run.cycle(Request.ARM)
        assert_safe(run)
        oldest_s, way_m = max(oldest_s, run.oldest_s), way_m + run.way_m
    assert way_m > 1.0 * len(seeds)
    return (
        f"{len(seeds)} random drives of 25 s with failing sensors: {way_m:.0f} m, {stops} stops, nothing touched; "
        f"no motion towards a direction unseen for more than {oldest_s:.2f} s (limit 1.5 s)"
    )


def test_sensors_fail_at_random(measured: Callable[[str], None]) -> None:
    measured(drive_at_random(range(1)))


@pytest.mark.soak
def test_sensors_fail_at_random_many_times(measured: Callable[[str], None]) -> None:
    measured(drive_at_random(range(100, 300)))


@pytest.mark.soak
def test_a_hall_in_which_the_sensors_ahead_hear_nothing_is_driven_to_its_end() -> None:
    """A silence that is only suspected, as neighbours hear the sides of the hall, still counts as a look."""
    chosen = settings("behaviors.move_ahead.distance_m=7.0")
    run = WatchedRun(chosen, long_hall(0), 0)
    run.until(26.0)
    assert [report.sensor for report in run.state.perception.sensor_reports()] == [0]
    assert run.mode is Mode.DRIVE
    assert run.way_m > 6.5
    assert_safe(run)
