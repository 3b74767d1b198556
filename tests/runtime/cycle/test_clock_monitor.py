"""The robot's clock against the run's: errors are found, how soon, and no honest delay is taken for one."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import pytest

from config.load import load_settings
from config.world import DrumConfig, WorldConfig
from drivers.emulator.faults import ClockError
from drivers.messages import Firing, Flags, Odometry, Pose, Twist
from runtime.cycle.clock_monitor import ClockMonitor, ClockState
from runtime.cycle.inputs import Request
from runtime.cycle.modes import CLOCK_REASONS, Mode
from tests.runtime.emulated_run import Run

HERE = Pose(0.0, 0.0, 0.0)


def sample(robot_s: float) -> Odometry:
    return Odometry(robot_s, HERE, 0.0, Twist(0.0, 0.0), Flags.NONE, 0)


@dataclass
class Line:
    """A robot that reports every `period_s`, by a clock of its own, over a way with delays."""

    clock: Callable[[float], float] = lambda t: t
    delay: Callable[[float], float] = lambda _: 0.005
    period_s: float = 0.02

    def cycles(self, until_s: float, held: tuple[float, float] = (0.0, 0.0)) -> Iterator[tuple[float, ClockMonitor]]:
        """Yield each cycle's time with the monitor after it; the program is held up between two times."""
        sent = np.arange(0.0, until_s, self.period_s)
        arrives = np.maximum.accumulate([t + self.delay(t) for t in sent])
        monitor, taken = ClockMonitor(), 0
        for run_s in np.arange(0.05, until_s, 0.05).tolist():
            if held[0] <= run_s < held[1]:
                continue
            came = int(np.searchsorted(arrives, run_s, side="right"))
            odometry = sample(self.clock(float(sent[came - 1]))) if came > taken else None
            monitor, taken = monitor.observe(odometry, (), run_s), came
            yield run_s, monitor

    def errors(self, until_s: float, held: tuple[float, float] = (0.0, 0.0)) -> list[tuple[float, ClockState]]:
        found = ((run_s, monitor.clock) for run_s, monitor in self.cycles(until_s, held))
        return [(run_s, clock) for run_s, clock in found if clock is not ClockState.RIGHT]


def wrong_from(at_s: float, rate: float = 1.0, leap_s: float = 0.0) -> Callable[[float], float]:
    return lambda t: t if t < at_s else t + leap_s + (rate - 1.0) * (t - at_s)


@pytest.mark.parametrize(("rate", "leap_s", "state", "within_s"), [
    (0.0, 0.0, ClockState.STANDS, 0.45), (0.2, 0.0, ClockState.SLOW, 0.65), (0.5, 0.0, ClockState.SLOW, 0.85),
    (0.7, 0.0, ClockState.SLOW, 1.2), (1.5, 0.0, ClockState.FAST, 0.65), (2.0, 0.0, ClockState.FAST, 0.4),
    (10.0, 0.0, ClockState.FAST, 0.1), (1.0, 0.4, ClockState.FAST, 0.1), (1.0, 5.0, ClockState.FAST, 0.1),
    (1.0, -0.6, ClockState.STANDS, 0.45),
])  # fmt: skip
@pytest.mark.parametrize("period_s", [0.02, 0.05, 0.1])
def test_wrong_clocks_are_found_within_a_second(
    rate: float, leap_s: float, state: ClockState, within_s: float, period_s: float
) -> None:
    rng = np.random.default_rng(1)
    for _ in range(20):
        at_s = float(rng.uniform(5.1, 20.0))
        line = Line(wrong_from(at_s, rate, leap_s), lambda _: float(rng.uniform(0.002, 0.03)), period_s)
        found_s, found = line.errors(at_s + 3.0)[0]
        assert found is state
        assert at_s < found_s < at_s + within_s + 2.0 * period_s


@pytest.mark.parametrize("lines", [20, pytest.param(60, marks=pytest.mark.soak)])
def test_no_honest_delay_is_taken_for_a_wrong_clock(lines: int, measured: Callable[[str], None]) -> None:
    rng = np.random.default_rng(2)
    for seed in range(lines):
        burst_s, every_s = float(rng.uniform(0.0, 0.4)), float(rng.uniform(0.5, 5.0))
        jitter_s, drift, period_s = float(rng.uniform(0.0, 0.05)), float(rng.uniform(-1e-3, 1e-3)), (0.02, 0.05, 0.1)
        noise = np.random.default_rng(seed)

        def delay(t: float, burst: float = burst_s, every: float = every_s, jitter: float = jitter_s) -> float:
            held = max(0.0, burst - t % every)  # all that is sent during a burst arrives at its end
            return 0.003 + held + float(noise.uniform(0.0, jitter))  # noqa: B023 - called in this turn only

        line = Line(lambda t, rate=1.0 + drift: 100.0 + rate * t, delay, period_s[seed % 3])  # type: ignore[misc]  # mypy knows no defaults of lambdas
        begin_s = float(rng.uniform(1.0, 60.0))
        assert line.errors(80.0, (begin_s, begin_s + float(rng.uniform(0.0, 2.0)))) == [], seed
    measured(f"{lines} jittery lines, 80 s each, with bursts up to 0.4 s and a stall up to 2 s: 0 false alarms")


def test_a_lasting_delay_is_no_slow_clock_and_twofold_samples_are_no_latch() -> None:
    assert Line(delay=lambda t: 0.005 if t < 10.0 else 0.35).errors(30.0) == []
    assert Line(clock=lambda t: round(t / 0.1) * 0.1).errors(30.0) == []


def test_no_echo_is_younger_than_the_time_since_its_arrival() -> None:
    monitor, firing = ClockMonitor(), Firing(5.0, HERE, 0.0, np.full(4, 1.0))
    assert monitor.now_s(5.0, 10.0) == 5.0
    monitor = monitor.observe(sample(5.02), (firing,), 10.0)
    assert monitor.now_s(5.02, 10.0) == 5.02
    assert monitor.now_s(5.02, 10.5) == pytest.approx(5.5)
    assert monitor.now_s(5.6, 10.5) == 5.6


@pytest.mark.compiled
def test_a_latched_clock_stops_the_drive_and_refuses_to_arm() -> None:
    settings = load_settings("hallway")
    world = WorldConfig(drum=(DrumConfig(x_m=-2.0, y_m=0.0, radius_m=0.3),))  # behind, so that the ring hears
    run = Run(settings, world, 0, (ClockError(kind="clock_error", at_s=4.0, duration_s=99.0),))
    run.until_true(lambda: run.mode is Mode.SAFE_STOP, 4.5)
    assert (run.state.mode.reason, 4.0 < run.run_s < 4.5) == (CLOCK_REASONS[ClockState.STANDS], True)
    run.until(5.0)
    run.cycle(Request.ARM)
    run.until(6.0)
    assert (run.mode, run.state.mode.reason) == (Mode.SAFE_STOP, CLOCK_REASONS[ClockState.STANDS])


def test_a_ring_fires_for_as_long_as_since_its_first_firing_on_this_line() -> None:
    monitor, found = ClockMonitor(), []
    for k in range(400):
        run_s = 10.0 + 0.05 * k
        firing = Firing(0.05 * k, HERE, 0.0, np.full(4, 1.0))
        monitor = monitor.observe(None, (firing,) if k >= 10 else (), run_s)
        found.append(monitor.fired_s(run_s))
    assert found[:12] == pytest.approx([0.0] * 11 + [0.05])
    assert found[60] == pytest.approx(2.5)
    assert found[-1] == np.inf
