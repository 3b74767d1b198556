"""That tests in real time excuse nothing but a machine that stood still."""

from __future__ import annotations

import logging
import signal
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.hil import machine
from tests.hil.machine import TRIALS, BareStarts, Witness, stalls_excused
from tests.hil.running import wait_for


def witness_of(*stalls_s: float) -> type[Witness]:
    """Return a witness that has seen these standstills."""

    class Scripted(Witness):
        def __init__(self) -> None: ...

        def __exit__(self, *_: object) -> None: ...

        def stalls_s(self) -> list[float]:
            return list(stalls_s)

    return Scripted


def failing(times: int) -> tuple[Callable[..., None], list[Path]]:
    """Return a test that fails so many times, and the folders it was given."""
    folders: list[Path] = []

    @stalls_excused
    def test(tmp_path: Path) -> None:
        folders.append(tmp_path)
        assert len(folders) > times, "planted"

    return test, folders


def test_a_failure_on_a_machine_that_kept_its_time_is_one(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(machine, "Witness", witness_of())
    test, folders = failing(1)
    with pytest.raises(AssertionError, match="planted"):
        test(tmp_path=tmp_path)
    assert folders == [tmp_path]


def test_trial_on_a_stalled_machine_is_repeated_and_reported(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(machine, "Witness", witness_of(0.7))
    test, folders = failing(1)
    with caplog.at_level(logging.WARNING):
        test(tmp_path=tmp_path)
    assert len({*folders}) == 2
    assert "0.7" in caplog.text
    assert "planted" in caplog.text


def test_what_fails_every_time_fails(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(machine, "Witness", witness_of(0.7))
    test, folders = failing(1000)
    with pytest.raises(AssertionError, match="planted"):
        test(tmp_path=tmp_path)
    assert len(folders) == TRIALS


async def test_coroutines_are_repeated_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine, "Witness", witness_of(0.7))
    trials: list[None] = []

    @stalls_excused
    async def test() -> None:
        trials.append(None)
        assert len(trials) == 2

    await test()


def test_the_witness_notes_that_it_was_kept_from_running() -> None:
    stalls_s: list[float] = []
    with Witness() as witness:
        # Again and again: the first signals may come before it looks at the clock.
        def seen() -> bool:
            for process in witness._processes:
                process.send_signal(signal.SIGSTOP)
            time.sleep(2.0 * machine.STALL_S)
            for process in witness._processes:
                process.send_signal(signal.SIGCONT)
            stalls_s.extend(witness.stalls_s())
            return bool(stalls_s)

        wait_for(seen, "a standstill")
        assert min(stalls_s) > machine.STALL_S - 1e-3


def test_a_bare_start_takes_its_time() -> None:
    with BareStarts() as bare:
        pass
    assert bare.longest_s > 0.01
