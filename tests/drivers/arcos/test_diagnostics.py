"""Messages about a Pioneer: which robot is refused, and what is said about its line."""

from __future__ import annotations

from dataclasses import replace

import pytest

from config.files import one_line
from drivers.arcos.diagnostics import (
    deadman_s,
    no_answer,
    traits,
    unanswered,
    watchdog_note,
    wrong_robot,
    wrong_watchdog,
)
from drivers.arcos.frames import ConfigPacket, RobotName
from drivers.arcos.handshake import Stage
from drivers.heard_bytes import HeardBytes
from tests.drivers.arcos.harness import P3DX_FILE
from tests.drivers.arcos.vectors import P3DX


@pytest.mark.parametrize("subclass", ["p3dx", "P3DX", "p2d8+", "p3dx \r\n", None])
def test_a_robot_of_the_files_models_or_without_a_name_is_accepted(subclass: str | None) -> None:
    assert wrong_robot(RobotName("a", "Pioneer", subclass), P3DX_FILE) is None


@pytest.mark.parametrize(
    ("subclass", "said"),
    [
        ("p3at", "is a p3at"),
        ("p3dx-sh", "is a p3dx-sh"),
        ("", "does not say of which model it is"),
    ],
)
def test_a_robot_with_other_factors_is_refused(subclass: str, said: str) -> None:
    message = wrong_robot(RobotName("a\x1b[2J", "Pioneer", subclass), P3DX_FILE) or ""
    assert f"{said}, and the robot file is for p3dx, p2d8, p2d8+" in message
    assert "\x1b" not in message
    assert ("add its subclass" in message) == ("has other factors" in message) == bool(subclass)
    assert ("may be others" in message) == ("set arcos.subclasses to []" in message) == (not subclass)


def test_a_robot_says_more_of_itself_than_its_name() -> None:
    packet = ConfigPacket(serial="17\x1b", rear_sonar=1, speed_max=300)
    said = dict(traits(packet, RobotName("a", "Pioneer", "p3dx")))
    assert said == {"class": "Pioneer", "subclass": "p3dx", "serial number": one_line("17\x1b"), "rear sonar": "1"}
    assert traits(None, None) == ()


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
    heard = HeardBytes()
    assert "at 9600, 38400 baud and nothing is received" in no_answer((9600, 38400), 0, heard)
    heard.received(b"\xf3" * 9)
    assert "no answer to SYNC0, and what is received is no frame" in no_answer((), 0, heard)
    assert "no answer to SYNC0 although the robot sends other frames" in no_answer((), 1, heard)
    heard.has_frames = True
    assert "no answer to SYNC0, although valid frames of a robot came before" in no_answer((), 0, heard)
    heard.received(b"Hello from the sketch\r\n" * 9)
    assert "and a device sends text, as 'Hello from the sketch'" in no_answer((), 1, heard)
    assert "as 'Hello from the sketch'" in unanswered(Stage.SYNC1, heard)


@pytest.mark.parametrize("stage", [Stage.CLOSING, Stage.SYNC1, Stage.SYNC2, Stage.CONFIG, Stage.DONE])
def test_each_stage_that_stays_unanswered_is_named(stage: Stage) -> None:
    message = unanswered(stage, HeardBytes())
    assert message.count("; ") == 1
    assert ": " in message
    assert (stage.value in message) or stage in {Stage.CLOSING, Stage.DONE}


def test_the_note_about_the_watchdog_names_its_time() -> None:
    assert "only 0.7 s after the last command" in watchdog_note(0.7)
