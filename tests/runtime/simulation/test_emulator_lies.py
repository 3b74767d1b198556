"""P9: the map recovers from false readings: outliers, a burst of garbage and a jump of the odometry."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from drivers.driver import LineState
from drivers.emulator.faults import Fault, Garbage, OdometryJump, Outliers, StuckSensor
from perception.detected_object import turned_object
from runtime.cycle.logs.alerts import Alerts
from runtime.cycle.modes import Mode
from tests.runtime.emulated_run import FT, Run, hallway

pytestmark = [pytest.mark.compiled]
promise = pytest.mark.promise("P9")

READINGS = 20
BACK_FT = 0.05
GHOST_FT = 1.0
FORGOTTEN_S = 10.0
FROM_S, UNTIL_S = 14.0, 26.0


def leap(at_s: float, way: float, turn_rad: float = 0.0) -> OdometryJump:
    """Return a jump of one foot in direction `way`."""
    dx, dy = FT * math.cos(way), FT * math.sin(way)
    return OdometryJump(kind="odometry_jump", at_s=at_s, dx_m=dx, dy_m=dy, dheading_rad=turn_rad)


def outliers(at_s: float, share: float, duration_s: float) -> Outliers:
    return Outliers(kind="outliers", at_s=at_s, share=share, duration_s=duration_s)


LIES: dict[str, Callable[[int], tuple[Fault, float]]] = {
    "20 % outliers from then on": lambda _: (outliers(FROM_S, 0.2, 1e3), FROM_S),
    "nothing but outliers for 1 s": lambda _: (outliers(FROM_S, 1.0, 1.0), FROM_S + 1.0),
    "8,000 bytes of garbage in 1 s": lambda k: (
        Garbage(kind="garbage", at_s=FROM_S + 0.013 * k, duration_s=1.0, bytes_per_s=8000.0),
        FROM_S + 0.013 * k + 1.0,
    ),
    "the odometry leaps by 1 ft": lambda k: (leap(FROM_S + 0.0137 * k, 1.1 * k), FROM_S + 0.0137 * k),
    "and by 20 degrees": lambda k: (leap(FROM_S + 0.0137 * k, 1.1 * k, 0.35), FROM_S + 0.0137 * k),
}
SHORT = [
    pytest.param(
        lie, marks=[pytest.mark.soak] if lie in {"nothing but outliers for 1 s", "and by 20 degrees"} else []
    )
    for lie in LIES
]
"""In `make test` the promise's own; the others differ in their sizes."""
BY_PAPER = [pytest.param(lie, marks=[pytest.mark.soak] if k else []) for k, lie in enumerate(LIES)]
"""The paper's method forgets what is false in the same way whatever it was."""
SEEDS, PAPER_SEEDS, SOAK_SEEDS = range(1), range(1, 2), range(24)
"""Of the runs: in `make test`, there by the paper's method, and in `make soak`."""


def recover(run: Run, over_s: float) -> tuple[float, float]:
    """Drive on after a fault that ends at `over_s`.

    Return the largest error from the twentieth reading after the fault on, and the largest after 10 s, feet.
    """
    run.until(over_s)
    before, worst, late = len(run.firings), 0.0, 0.0
    while run.run_s < UNTIL_S:
        run.cycle()
        errors = run.errors_ft()
        if len(run.firings) - before >= READINGS:
            worst = max([worst, *errors])
        if run.run_s > over_s + FORGOTTEN_S:
            late = max([late, *errors])
    assert len(run.firings) - before >= READINGS
    return worst, late


def worst_by_bayes(lie: str, seeds: range) -> float:
    """Check the Bayesian method against a fault; return the largest error from the twentieth reading on, feet."""
    worst_ft = 0.0
    for seed in seeds:
        fault, over_s = LIES[lie](seed)
        run = hallway(seed, fault)
        worst, late = recover(run, over_s)
        assert worst <= BACK_FT, seed
        assert late <= BACK_FT, seed
        assert len(run.objects_ft()) >= 4
        worst_ft = max(worst_ft, worst)
    return worst_ft


def worst_by_paper(lie: str, seeds: range) -> float:
    """Check the paper's method against a fault; return the largest error after 10 s, feet.

    Its own bias is 0.2 ft, so only objects that do not exist are counted as errors.
    """
    worst_ft = 0.0
    for seed in seeds:
        fault, over_s = LIES[lie](seed)
        run = hallway(seed, fault, method="paper")
        _, late = recover(run, over_s)
        assert late < GHOST_FT, seed
        assert run.objects_ft()
        worst_ft = max(worst_ft, late)
    return worst_ft


@promise
@pytest.mark.parametrize("lie", SHORT)
def test_the_bayesian_method_is_right_again_within_twenty_readings(lie: str, measured: Callable[[str], None]) -> None:
    worst_ft = worst_by_bayes(lie, SEEDS)
    measured(f"{lie}, {len(SEEDS)} seeds: from the 20th reading on every object within {worst_ft:.3f} ft of a drum")


@promise
@pytest.mark.parametrize("lie", BY_PAPER)
def test_the_paper_s_method_keeps_no_false_object(lie: str, measured: Callable[[str], None]) -> None:
    worst_ft = worst_by_paper(lie, PAPER_SEEDS)
    measured(f"the paper's method, {lie}: after 10 s every object within {worst_ft:.2f} ft of a drum")


@promise
@pytest.mark.soak
@pytest.mark.parametrize("lie", LIES)
def test_recovery_on_many_seeds(lie: str, measured: Callable[[str], None]) -> None:
    bayes_ft, paper_ft = worst_by_bayes(lie, SOAK_SEEDS), worst_by_paper(lie, SOAK_SEEDS)
    measured(f"{lie}, {len(SOAK_SEEDS)} seeds: within {bayes_ft:.3f} ft, by the paper's method {paper_ft:.2f} ft")


@promise
def test_a_leap_is_reported_and_the_robot_drives_on(measured: Callable[[str], None]) -> None:
    run = hallway(3, leap(FROM_S, 0.0))
    run.until(FROM_S + 1.0)
    assert run.state.mode.mode is Mode.DRIVE
    (note,) = run.notes
    assert note.startswith("the odometry jumped by 0.30 m and ")
    # Objects are reported in the robot's own odometry, which is now a foot off.
    frame = run.driver.odometry_origin
    assert (frame.x / FT, frame.y / FT) == pytest.approx((1.0, 0.0), abs=0.02)
    for seen in run.state.perception.objects():
        assert turned_object(frame, seen).x - seen.x == pytest.approx(FT, abs=0.01)
    measured("a leap of 1 ft in mid-run: no stop, one line to the operator")


@promise
@pytest.mark.parametrize("rate", [200.0, pytest.param(8000.0, marks=pytest.mark.soak)])
def test_noise_stops_it_only_where_it_lasts_and_is_named(rate: float, measured: Callable[[str], None]) -> None:
    """A frame with noise before it is lost. Without odometry the robot stops after .4 s (`link.silence_max_s`); where
    an odometry happens to follow an echo's end it arrives, and the robot stops once the last echo is too old, 1.5 s.
    Either way the cause is named, and it does not resume by itself."""
    latest_s = 0.0
    for seed in SEEDS:
        noise = [
            Garbage(kind="garbage", at_s=at_s + 0.017 * seed, duration_s=lasts_s, bytes_per_s=rate)
            for at_s, lasts_s in ((10.0, 0.3), (FROM_S, 1.8))
        ]
        run = hallway(seed, *noise)
        run.until(FROM_S)
        driving = run.state.mode
        assert driving.mode is Mode.DRIVE, "a third of a second does not stop it"
        bad = run.driver.counts.bad
        run.until(FROM_S + 1.9)
        assert run.driver.counts.bad > bad + 50
        stopped = run.state.mode
        assert stopped.mode is Mode.SAFE_STOP
        reason = str(stopped.reason)
        assert "corrupt frames came in" in reason
        assert "noise on the line" in reason
        after_s = stopped.entered_run_s - (FROM_S + 0.017 * seed)
        assert 0.35 < after_s < 1.7
        latest_s = max(latest_s, after_s)
        firings = len(run.firings)
        run.until(FROM_S + 3.6)
        assert run.driver.state is LineState.READY
        assert run.driver.problem is None
        assert len(run.firings) > firings + 20
        assert run.state.mode.mode is Mode.SAFE_STOP, "motion never resumes by itself"
        assert run.state.mode.entered_run_s == stopped.entered_run_s
        assert "noise on the line" in str(run.state.mode.reason)
    measured(f"{rate:g} bytes of noise a second: no stop for 0.3 s; SAFE_STOP after {latest_s:.2f} s, cause named")


@pytest.mark.promise("P8")
def test_a_robot_with_broken_sensors_drives_on_and_says_which(measured: Callable[[str], None]) -> None:
    """One sensor fails and one sticks: both are named, and every drum is located."""
    faults = (
        StuckSensor(kind="stuck_sensor", at_s=2.0, duration_s=1e3, sensor=7),
        StuckSensor(kind="stuck_sensor", at_s=2.0, duration_s=1e3, sensor=5, range_m=1.2),
    )
    run, alerts, lines = hallway(0, *faults), Alerts(), list[str]()
    while run.run_s < UNTIL_S:
        record = run.cycle()
        lines += alerts.update(record.inputs.received, run.state, run.run_s)
    assert {r.sensor: r.fault for r in run.state.perception.sensor_reports()} == {5: "stuck", 7: "failing"}
    assert len(lines) == 2
    assert "sensor 7 never answers when it should fire" in lines[0]
    assert "sensor 5 always answers 1.19 m" in lines[1]
    errors = run.errors_ft()
    assert len(errors) == 6
    assert max(errors) < BACK_FT
    measured(f"the hallway with one sensor failing and one stuck: both named, six drums within {max(errors):.3f} ft")
