"""Messages about a Pioneer: which robot is refused, and what is said about its line."""

from __future__ import annotations

from dataclasses import replace

import pytest

from drivers.arcos.diagnostics import deadman_s, no_answer, watchdog_note, wrong_robot, wrong_watchdog
from drivers.arcos.frames import ConfigPacket, RobotName
from tests.drivers.arcos.harness import P3DX_FILE
from tests.drivers.arcos.vectors import P3DX


@pytest.mark.parametrize("subclass", ["p3dx", "P3DX", "p2d8+", None])
def test_a_robot_of_the_files_models_or_without_a_name_is_accepted(subclass: str | None) -> None:
    assert wrong_robot(RobotName("a", "Pioneer", subclass), P3DX_FILE) is None


@pytest.mark.parametrize("subclass", ["p3at", "p3dx-sh", ""])
def test_a_robot_with_other_factors_is_refused(subclass: str) -> None:
    message = wrong_robot(RobotName("a\x1b[2J", "Pioneer", subclass), P3DX_FILE) or ""
    assert f"is a {subclass}, and the robot file is for p3dx, p2d8, p2d8+" in message
    assert "\x1b" not in message


def test_the_watchdog_is_the_robots_or_that_of_the_firmware_as_delivered() -> None:
    assert deadman_s(P3DX) == deadman_s(None) == deadman_s(ConfigPacket()) == 2.0
    assert deadman_s(replace(P3DX, watchdog_ms=500)) == 0.5


def test_a_watchdog_that_is_off_or_slow_is_refused() -> None:
    assert wrong_watchdog("a", P3DX, P3DX_FILE) is None
    assert "is off, so that its base never stops" in (
        wrong_watchdog("a", replace(P3DX, watchdog_ms=0), P3DX_FILE) or ""
    )
    assert "stops by itself 2.5 s after" in (wrong_watchdog("a", replace(P3DX, watchdog_ms=2500), P3DX_FILE) or "")


def test_the_message_about_a_mute_line_says_what_was_tried_and_heard() -> None:
    assert "at 9600, 38400 baud and nothing is received" in no_answer(bauds=(9600, 38400), heard=0)
    assert "no answer to SYNC0, and what is received is no frame" in no_answer(bauds=(), heard=9)


def test_the_note_about_the_watchdog_names_its_time() -> None:
    assert "only 0.7 s after the last command" in watchdog_note(0.7)
