"""P8: a ring that lies while the robot drives: a stop with the reason, before anything is touched at speed."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from config.load import load_settings
from drivers.emulator.faults import ConstantRing, Fault, FrozenRing, Outliers, SilentRing, StuckSensor, TurnedRing
from runtime.cycle.modes import Mode
from tests.runtime.emulated_run import Run

pytestmark = [pytest.mark.promise("P8"), pytest.mark.compiled]

AT_S, LASTS_S = 5.0, 100.0
TOUCH_M_S = 0.05
LIES: dict[str, tuple[Fault, str]] = {
    "frozen": (FrozenRing(kind="frozen_ring", at_s=AT_S, duration_s=LASTS_S), "the ring repeats old readings"),
    "silent": (SilentRing(kind="silent_ring", at_s=AT_S, duration_s=LASTS_S), "most echoes that the ring heard"),
    "constant": (ConstantRing(kind="constant_ring", at_s=AT_S, duration_s=LASTS_S), "the ring"),
    "random": (
        Outliers(kind="outliers", at_s=AT_S, duration_s=LASTS_S, share=1.0),
        "the ring's readings are unrelated",
    ),
    "turned": (TurnedRing(kind="turned_ring", at_s=0.0, duration_s=LASTS_S, angle_deg=180.0), "turned by 180°"),
}


def driven(robot: str, *faults: Fault, until_s: float = 20.0) -> Run:
    """Return a drive across the shipped room, of rough walls, without recognition."""
    settings = load_settings("room", robot=robot)
    assert settings.world is not None
    rough = settings.world.acoustics.model_copy(update={"model": "cone", "noise_relative": 0.01})
    run = Run(settings, settings.world.model_copy(update={"acoustics": rough}), 1, faults, preparing="left out")
    while run.run_s < until_s and run.mode is not Mode.SAFE_STOP:
        run.cycle()
    return run


@pytest.mark.parametrize("robot", ["denning", pytest.param("p3dx", marks=pytest.mark.soak)])
@pytest.mark.parametrize(
    "lie", [pytest.param(lie, marks=[pytest.mark.soak] if lie in {"constant", "random"} else []) for lie in LIES]
)
def test_it_stops_with_the_reason_before_it_touches_anything(
    lie: str, robot: str, measured: Callable[[str], None]
) -> None:
    fault, reason = LIES[lie]
    run = driven(robot, fault, until_s=30.0)  # one that seems turned creeps until it is named
    assert run.mode is Mode.SAFE_STOP
    assert reason in str(run.state.mode.reason)
    assert str(run.state.mode.reason).endswith(", then re-arm")
    assert run.truths[-1].contact_m_s <= TOUCH_M_S
    measured(f"{robot}, {lie}: stopped {run.run_s - fault.at_s:.2f} s later")


@pytest.mark.parametrize("robot", [pytest.param("denning", marks=pytest.mark.soak), "p3dx"])
def test_an_honest_ring_drives_on(robot: str) -> None:
    run = driven(robot, until_s=15.0)
    assert run.mode is Mode.DRIVE
    assert run.truths[-1].contacts == 0


def test_sensors_that_read_what_they_cannot_are_named_and_stop_the_robot(measured: Callable[[str], None]) -> None:
    """As waterproof modules do that need a longer trigger: the robot does not turn for ever."""
    ahead = [StuckSensor(kind="stuck_sensor", at_s=0.0, duration_s=LASTS_S, sensor=i, range_m=0.01) for i in (3, 4)]
    run = driven("p3dx", *ahead)
    assert run.mode is Mode.SAFE_STOP
    assert "no usable range from sensor 3, 4" in str(run.state.mode.reason)
    assert {r.sensor: r.fault for r in run.state.perception.sensor_reports()} == dict.fromkeys((3, 4), "too_near")
    measured(f"two sensors ahead that answer 1 cm: named, SAFE_STOP after {run.run_s:.1f} s")


@pytest.mark.parametrize(
    ("range_m", "fault"), [pytest.param(0.09, "too_near", marks=pytest.mark.soak), (0.12, "stuck")]
)
def test_a_robot_that_turns_away_from_what_its_sensors_repeat_does_not_turn_for_ever(
    range_m: float, fault: str
) -> None:
    ahead = [
        StuckSensor(kind="stuck_sensor", at_s=0.0, duration_s=LASTS_S, sensor=i, range_m=range_m) for i in (3, 4)
    ]
    run = driven("p3dx", *ahead, until_s=30.0)
    assert run.mode is Mode.SAFE_STOP
    assert "no usable range from sensor 3, 4" in str(run.state.mode.reason)
    assert {r.sensor: r.fault for r in run.state.perception.sensor_reports()} == dict.fromkeys((3, 4), fault)


def test_a_robot_whose_other_beams_cover_the_way_drives_on_without_them() -> None:
    ahead = [StuckSensor(kind="stuck_sensor", at_s=0.0, duration_s=LASTS_S, sensor=i, range_m=0.01) for i in (0, 1)]
    run = driven("ears", *ahead, until_s=10.0)
    assert run.mode is Mode.DRIVE
    assert run.truths[-1].twist.v > 0.1
    assert {r.fault for r in run.state.perception.sensor_reports()} == {"too_near"}
