"""The turn before the first drive: when it is made, how fast, and what it finds of a robot that is wired wrongly."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import pytest

from behaviors.teleoperation import Teleoperate
from config.load import load_settings
from config.settings import Settings
from drivers.messages import Pose, Twist
from runtime.cycle.drive_requests import STANDSTILL, DriveRequest, Legs
from runtime.cycle.modes import Mode
from runtime.cycle.start_turn import TURNS, StartTurn
from tests.drivers.device_host import script
from tests.runtime.emulated_run import Run

AHEAD = Twist(0.3, 0.1)
NAMED_S = 5.5
"""After it was armed: a whole turn, and the time that the base needs to speed up."""


def hobby(**body: Any) -> Settings:
    settings = load_settings("room", robot="hobby8")
    return settings.model_copy(update={"body": settings.body.model_copy(update=body)})


def applied(
    turn: StartTurn,
    theta: float,
    settings: Settings,
    twist: Twist = AHEAD,
    request: DriveRequest | None = None,
    *,
    agrees: bool = True,
) -> tuple[StartTurn, Twist, str | None]:
    return turn.apply(twist, None, Pose(0.0, 0.0, theta), request or Legs(), settings, lambda: agrees)


@pytest.mark.parametrize("agrees", [True, False])
def test_it_turns_once_and_again_after_a_fault(agrees: bool) -> None:
    settings, turn = hobby(), StartTurn()
    for k in range(63):  # headings that wrap
        turn, twist, why = applied(turn, math.remainder(1.0 + 0.1 * k, math.tau), settings)
        assert (twist.v, why) == (0.0, TURNS)
        assert 0.5 < twist.w <= settings.body.turn_max_rad_s
    turn, twist, why = applied(turn, 1.0 + 6.3, settings, agrees=agrees)
    assert (twist, why) == (STANDSTILL, TURNS)
    assert turn == StartTurn(is_over=agrees)
    assert (applied(turn, 1.0, settings)[1] == AHEAD) is agrees


def test_it_turns_only_as_it_sets_out_by_itself_and_only_robots_that_are_to() -> None:
    assert applied(StartTurn(), 0.0, hobby(), STANDSTILL) == (StartTurn(), STANDSTILL, None)
    assert applied(StartTurn(), 0.0, hobby(), request=Teleoperate(0.3, 0.1)) == (StartTurn(), AHEAD, None)
    for body in ({"turns_at_start": False}, {"synchro": True}):
        assert applied(StartTurn(), 0.0, hobby(**body)) == (StartTurn(), AHEAD, None)
    assert not load_settings("room", robot="p3dx").body.turns_at_start


FAULTS: Mapping[str, tuple[dict[str, Any], str]] = {
    "exchanged": ({"kind": "swapped_sensors", "first": 0, "second": 2}, "sensors 0 and 2 each hear"),
    "backwards": ({"kind": "turned_ring", "sensors": [3], "angle_deg": 180.0}, "sensor 3 hears what the others hear"),
    "deaf": ({"kind": "silent_ring", "sensors": [3]}, "sensor 3 heard nothing in a whole turn"),
}


@pytest.mark.compiled
@pytest.mark.parametrize("kind", [None, *FAULTS])
def test_a_fault_of_the_wiring_is_named_before_the_robot_drives(kind: str | None) -> None:
    """A front sensor that was deaf or looked backwards let hobby8 drive into the wall ahead at .3 m/s."""
    settings = load_settings("room", robot="hobby8")
    assert settings.world is not None
    faults = script(**(FAULTS[kind][0] | {"at_s": 0.0, "duration_s": 99.0})) if kind else ()
    run = Run(settings, settings.world, 2, faults, preparing="left out")
    run.until_true(lambda: run.mode is Mode.DRIVE, 5.0)
    end_s, start = run.run_s + NAMED_S, run.truths[-1].pose
    while run.run_s < end_s and run.mode is Mode.DRIVE and not run.state.start_turn.is_over:
        run.cycle()
    if kind is None:
        assert run.mode is Mode.DRIVE
        assert run.state.start_turn.is_over
    else:
        assert FAULTS[kind][1] in str(run.state.mode.reason)
    now = run.truths[-1].pose
    assert math.hypot(now.x - start.x, now.y - start.y) < 0.01
