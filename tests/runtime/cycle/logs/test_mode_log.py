"""The log of modes: bounded for a robot that loses and regains its line in every cycle."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest
import structlog

from runtime.cycle.logs.mode_log import LINES_BURST, LINES_PER_S, STOP_REASONS_MAX, ModeLog
from runtime.cycle.modes import RESTORED, STARTING, WAITING, Mode, ModeState
from runtime.support.sd_notify import SdNotifier


@pytest.mark.promise("P22")
def test_a_robot_that_changes_the_mode_in_every_cycle_fills_neither_log_nor_memory() -> None:
    lines: list[dict[str, Any]] = []

    def keep(_logger: object, _name: str, event: Any) -> Any:
        lines.append(dict(event))
        raise structlog.DropEvent

    log = ModeLog(structlog.wrap_logger(None, processors=[keep]), SdNotifier())
    seconds = 600
    for k in range(20 * seconds):
        mode = ModeState(Mode.SAFE_STOP if k % 2 else Mode.READY, 0.05 * k, f"reason {k}")
        state: Any = SimpleNamespace(mode=mode, cycle=k)
        log.entered(state, 0.05 * k)
    assert len(lines) <= LINES_BURST + LINES_PER_S * seconds
    assert len(lines) + sum(line.get("suppressed_before", 0) for line in lines) >= 20 * (seconds - 1)
    assert len(log.stop_reasons) == STOP_REASONS_MAX
    assert log.stop_reasons[-1] == f"reason {20 * seconds - 1}"
    assert re.fullmatch(r"reason \d+", lines[-1]["reason"])


def drop(_logger: object, _name: str, _event: Any) -> Any:
    raise structlog.DropEvent


def test_of_one_stop_each_reason_is_kept_once_whatever_its_numbers() -> None:
    """Why the line does not return may be another reason than why it was lost."""
    log, before = ModeLog(structlog.wrap_logger(None, processors=[drop]), SdNotifier()), ModeState()
    silent, deaf = "nothing received for {:.2f} s", "no answer to 3 HALT commands"
    stop = ModeState(Mode.SAFE_STOP, 1.0)
    reasons = [
        silent.format(0.4), WAITING + silent.format(0.45), WAITING + STARTING, WAITING + deaf,
        WAITING + silent.format(1.4), WAITING + deaf, f"{RESTORED} (what was wrong: {deaf})",
    ]  # fmt: skip
    for k, reason in enumerate(reasons):
        state: Any = SimpleNamespace(mode=replace(stop, reason=reason), cycle=k, hold_reason=None, drive_request=None)
        log.observe(state, before, 0.05 * k)
        before = state.mode
    assert log.stop_reasons == [silent.format(0.4), deaf]
    state.mode = replace(stop, reason=deaf)
    log.observe(state, ModeState(Mode.DRIVE), 2.0)
    assert log.stop_reasons[2:] == [deaf], "another stop"


def test_what_a_start_waits_for_is_no_stop_and_a_line_that_is_lost_in_ready_is_one() -> None:
    log, before = ModeLog(structlog.wrap_logger(None, processors=[drop]), SdNotifier()), ModeState()
    unanswered, lost = "the robot does not answer HELLO", "the line to the robot is gone"
    modes = [
        ModeState(), ModeState(reason=unanswered), ModeState(Mode.READY, 1.0),
        ModeState(Mode.CONNECTING, 1.0, lost), ModeState(Mode.CONNECTING, 1.0, unanswered),
        ModeState(Mode.READY, 3.0),
    ]  # fmt: skip
    for k, mode in enumerate(modes):
        state: Any = SimpleNamespace(mode=mode, cycle=k, hold_reason=None, drive_request=None)
        log.observe(state, before, 0.05 * k)
        before = mode
    assert log.stop_reasons == [lost, unanswered]
