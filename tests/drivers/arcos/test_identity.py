"""Which Pioneer answers, and with which limits it drives."""

from __future__ import annotations

from dataclasses import replace

import pytest

from drivers.arcos.frames import RobotName
from drivers.driver import LineState
from tests.drivers.arcos.harness import Controller, Harness
from tests.drivers.arcos.vectors import P3DX


@pytest.mark.parametrize(
    ("controller", "problem"),
    [
        (Controller(replace(P3DX, watchdog_ms=0)), "never stops by itself"),
        (Controller(replace(P3DX, watchdog_ms=5000)), "stops by itself 5 s after"),
    ],
)
def test_a_robot_whose_watchdog_is_not_allowed_is_refused(controller: Controller, problem: str) -> None:
    harness = Harness(controller=controller)
    harness.open()
    harness.run(1.0)
    assert LineState.READY not in harness.states
    assert (harness.state(), harness.driver.is_other_robot) == (LineState.DOWN, True)
    assert problem in (harness.driver.problem or "")
    assert controller.session == "wait", "closed again"


def test_another_model_is_refused_before_its_session_and_asked_again_later() -> None:
    harness = Harness()
    harness.controller.name = RobotName("box", "Pioneer", "p3at")
    harness.open()
    harness.run(1.5)
    assert (harness.state(), harness.driver.is_other_robot) == (LineState.DOWN, True)
    assert "is a p3at, and the robot file is for p3dx" in (harness.driver.problem or "")
    assert harness.controller.session == "named"
    harness.controller.session, harness.controller.name = "wait", RobotName("box", "Pioneer", "p3dx")
    harness.run(5.0)
    assert harness.state() is LineState.READY


def test_firmware_without_a_configuration_gets_the_robot_files_limits() -> None:
    harness = Harness(controller=Controller(None))
    harness.ready()
    assert any("does not report its configuration" in note for note in harness.notes)
    assert not any("of which model" in note for note in harness.notes)
    assert harness.driver.identity is not None
    assert harness.driver.identity.deadman_s == 2.0


def test_a_simulator_that_does_not_say_its_model_is_taken_for_the_files_and_that_is_said() -> None:
    harness = Harness()
    harness.controller.name = RobotName("box")
    harness.ready()
    assert [note for note in harness.notes if "does not say of which model it is, likely it is a simulator" in note]
