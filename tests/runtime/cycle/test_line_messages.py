"""What a run says about its line when a program is at the other end: an emulator has no cable and no power."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, MutableMapping
from pathlib import Path
from typing import Any

import pytest
import structlog

from config.errors import UserError
from drivers import line_diagnostics
from drivers.arcos import diagnostics as arcos
from drivers.denning import diagnostics as denning
from drivers.driver import LineState
from drivers.emulator.faults import Fault, Mute
from drivers.heard_bytes import HeardBytes
from drivers.rflex import diagnostics as rflex
from drivers.stamper import EXCESS_FIRINGS
from runtime.cycle.line_messages import HARDWARE, ROBOT_LINE, ProgramLine, messages_on
from runtime.cycle.logs.line_log import CORRUPT, TOO_MANY
from runtime.cycle.modes import Mode
from runtime.cycle.process import RobotProcess
from tests.runtime.virtual_time import in_virtual_time

SILENCES = [
    line_diagnostics.silence(0.5, others=others, bad=bad) for others, bad in itertools.product((False, True), (0, 9))
]
NOTHING, NOISE = HeardBytes(), HeardBytes()
NOISE.received(b"\xf3\x9a" * 9)
UNANSWERED = [
    *(denning.no_answer("HELLO", 3, frames, NOTHING) for frames in (0, 9)),
    *(arcos.no_answer((9600,), frames, NOTHING) for frames in (0, 9)),
    *(rflex.no_answer(frames, NOTHING) for frames in (0, 9)),
]
DEAF = [denning.not_receiving(0.5), arcos.not_receiving(0.5), rflex.not_receiving(0.5)]
SETTINGS = [denning.refusal("PATTERN", 4), denning.no_answer("HELLO", 3, 0, NOISE)]
LOST = "the line /a was lost (its other end is closed); likely it was unplugged: plug it in again"
EMULATOR = ProgramLine("the emulator", "start the run again")


class Events:
    """A log that keeps its lines."""

    def __init__(self) -> None:
        self.events = list[dict[str, Any]]()
        self.log = structlog.wrap_logger(None, processors=[self._keep])

    def _keep(self, _logger: object, _name: str, event: MutableMapping[str, Any]) -> dict[str, Any]:
        self.events.append(dict(event))
        raise structlog.DropEvent

    def texts(self) -> Iterator[str]:
        for event in self.events:
            yield from (str(value) for value in event.values())


@pytest.mark.parametrize("text", [*SILENCES, *UNANSWERED, *DEAF])
def test_what_happened_stays_and_cause_and_action_are_the_emulator_s(text: str) -> None:
    assert HARDWARE.search(text), "as of a robot"
    assert ROBOT_LINE.problem(LineState.DOWN, text) == text
    said = EMULATOR.problem(LineState.DOWN, text) or ""
    is_late = "corrupt" not in text
    assert said.startswith(text.partition(";")[0] + f"; the emulator is {'stopped or late' if is_late else 'faulty'}")
    assert not HARDWARE.search(said)


@pytest.mark.parametrize("text", [EXCESS_FIRINGS, TOO_MANY.format(3000.0), CORRUPT.format(0.3, 30.0)])
def test_a_program_that_sends_too_much_is_not_late(text: str) -> None:
    said = EMULATOR.message(text)
    assert said.startswith(text.partition(";")[0] + "; the emulator is faulty, or its faults file asks for this")


@pytest.mark.parametrize("text", SETTINGS)
def test_what_settings_cause_is_said_as_it_is(text: str) -> None:
    assert EMULATOR.problem(LineState.DOWN, text) == text
    assert EMULATOR.message(text) == text


def test_nothing_is_added_where_nothing_is_wrong() -> None:
    assert EMULATOR.problem(LineState.READY, None) is None
    assert ROBOT_LINE.problem(LineState.CLOSED, None) is None


def test_an_emulator_that_has_ended_is_named_as_the_cause() -> None:
    over = ProgramLine("the emulator", "start the run again", lambda: True)
    gone = "the line to the emulator is closed; the emulator has ended: start the run again"
    assert over.problem(LineState.CLOSED, None) == gone
    assert over.problem(LineState.CLOSED, LOST) == gone
    assert (over.problem(LineState.DOWN, SILENCES[0]) or "").endswith("the emulator has ended: start the run again")
    assert "or its faults file" in (EMULATOR.problem(LineState.CLOSED, None) or ""), "a fault may close the line too"


def test_a_pseudo_terminal_leads_to_a_program(tmp_path: Path) -> None:
    port = tmp_path / "robot"
    port.symlink_to("/dev/pts/12345")
    assert f"the program at the other end of {port}" in (messages_on(str(port)).problem(LineState.CLOSED, None) or "")
    assert messages_on("/dev/ttyUSB0") is messages_on(None) is ROBOT_LINE


def test_a_program_that_does_not_answer_at_the_start_has_not_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    """The line is open until this program gives up, and that it is closed then is no loss."""
    log, silent = Events(), (Mute(kind="mute", at_s=0.0, duration_s=600.0),)
    with in_virtual_time(monkeypatch, faults=silent) as (loop, settings, *_):
        process = RobotProcess(settings, log.log, clock=loop.time, line_messages=EMULATOR)
        with pytest.raises(UserError, match=r"^no answer to \d HELLO .* received; the emulator is stopped or late"):
            loop.run_until_complete(process.run(arm=True, seconds=2.0))
    assert not [event for event in log.events if event["event"] == "line lost"]


@pytest.mark.promise("P31")
@pytest.mark.parametrize("faults", [(), (Mute(kind="mute", at_s=1.0, duration_s=9.0),)])
def test_no_line_of_an_emulated_run_names_hardware(
    monkeypatch: pytest.MonkeyPatch, faults: tuple[Fault, ...]
) -> None:
    """The emulator ends, or falls silent, in mid-drive."""
    log, ended = Events(), list[bool]()
    line = ProgramLine("the emulator", "start the run again", lambda: bool(ended))
    with in_virtual_time(monkeypatch, faults=faults) as (loop, settings, _robot, links):
        process = RobotProcess(settings, log.log, clock=loop.time, line_messages=line)

        def end() -> None:
            ended.append(True)
            links[0].pull()

        if not faults:
            loop.call_later(1.0, end)
        summary = loop.run_until_complete(process.run(arm=True, seconds=2.0))
    assert process.state.mode.mode is Mode.SAFE_STOP
    (reason,) = summary["stop_reasons"]
    assert ("the emulator has ended: start the run again" if ended else "the emulator is stopped or late") in reason
    assert not [text for text in log.texts() if HARDWARE.search(text)]
