"""Tests of the live view: what it stores, how often, and that another process draws it."""

from __future__ import annotations

import asyncio
import contextlib
import io
import math
import os
import pickle
import pty
import select
import signal
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from rich.console import Console

from config.load import load_settings
from drivers.registry import make_driver
from perception.detected_object import MapCounts
from runtime.cli.terminal import view
from runtime.cli.terminal.picture import Snapshot
from runtime.cli.terminal.view import EVERY_CYCLES, QUANTILES_PERIOD_S, View, after_each_cycle
from runtime.cycle.step import CycleRecord
from runtime.simulation.closed_loop import simulate
from runtime.timing.cycle_stats import CycleStats, Quantiles
from tests.hil.machine import TIMEOUT_S

SETTINGS = load_settings("hallway")
EMPTY = Snapshot(
    "CONNECTING", None, None, [], [], MapCounts(0, 0, 0), (), [math.nan] * 24, (0, 0, 0), 0, 0,
    {"p50": 0.0, "p99": 0.0, "max": 0.0}, {"p50": 0.0, "p99": 0.0, "max": 0.0},
)  # fmt: skip


class Terminal:
    """A view on a pseudo-terminal, and what it shows there."""

    def __init__(self, master: int, slave: int) -> None:
        self._master = master
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._done = False
        self.text = ""
        self.view = View(SETTINGS, Console(file=os.fdopen(slave, "w", closefd=False), force_terminal=True), "m")

    def until(self, word: str) -> None:
        """Read, from the first call on, until the word was shown."""
        if not self._reader.is_alive():
            self._reader.start()
        until(lambda: word in self.text)

    def close(self) -> None:
        """Read no more."""
        self._done = True
        if self._reader.is_alive():
            self._reader.join()

    def _read(self) -> None:
        while not self._done:
            if select.select([self._master], [], [], 0.05)[0]:
                self.text += os.read(self._master, 65536).decode(errors="replace")


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> Iterator[Terminal]:
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.setenv("LINES", "50")
    master, slave = pty.openpty()
    with contextlib.ExitStack() as stack:
        for fd in (master, slave):
            stack.callback(os.close, fd)
        shown = Terminal(master, slave)
        stack.callback(shown.close)
        yield shown


def until(done: Callable[[], bool]) -> None:
    end_s = time.monotonic() + TIMEOUT_S
    while not done():
        assert time.monotonic() < end_s, "timed out"
        time.sleep(0.005)


def test_a_drive_is_drawn_by_another_process(terminal: Terminal) -> None:
    assert SETTINGS.world is not None
    records: list[CycleRecord] = []
    run = simulate(SETTINGS, SETTINGS.world, 0, 8.0, lambda record, _truth: records.append(record))
    driver, stats = make_driver(SETTINGS), CycleStats(0.005)
    with terminal.view.shown():
        for record in records:
            stats.add_cycle(0.001)
            terminal.view.on_cycle(record, run.state, stats, driver)
        terminal.view.print("a line above it")
        terminal.until("DRIVE")
        terminal.until("outline segments")
        terminal.until("a line above it")
    until(lambda: all(thread.name != "view" for thread in threading.enumerate()))
    terminal.until("\x1b[?25h")  # the cursor is shown again
    terminal.view._mode = None  # the next cycle is drawn
    terminal.view.on_cycle(records[-1], run.state, stats, driver)
    snapshot = terminal.view._slot
    assert snapshot is not None
    assert snapshot.objects
    message = pickle.dumps(terminal.view._completed(snapshot))
    assert b"numpy" not in message, "or the other process imports it"
    assert b"drivers" not in message


def test_a_terminal_that_shows_nothing_delays_no_cycle(terminal: Terminal, monkeypatch: pytest.MonkeyPatch) -> None:
    """As one held by Ctrl-S: the picture's process waits, the loop does not, and the end does not for long."""
    monkeypatch.setattr(view, "LAST_S", 0.2)
    with terminal.view.shown():
        for _ in range(2000):  # far more than terminal and pipe hold
            terminal.view.print("x" * 1000)
        terminal.view.draw_again()
        assert terminal.view.probe() is None
        terminal.until("xxx")
    until(lambda: all(thread.name != "view" for thread in threading.enumerate()))


def test_that_the_drawing_process_ended_is_a_fault_with_its_error(terminal: Terminal) -> None:
    def seen() -> str | None:
        terminal.view.print("x")
        return terminal.view.probe()

    with terminal.view.shown():
        terminal.until("\x1b[?25l")
        picture = terminal.view._picture
        assert picture is not None
        picture.kill()
        until(lambda: seen() is not None)
    assert "the process that draws has ended" in (terminal.view.probe() or "")


def test_ctrl_c_leaves_the_end_of_the_picture_to_the_run(terminal: Terminal) -> None:
    with terminal.view.shown():
        terminal.until("\x1b[?25l")
        picture = terminal.view._picture
        assert picture is not None
        picture.send_signal(signal.SIGINT)
        terminal.view.print("still drawn")
        terminal.until("still drawn")
    assert picture.returncode == 0


def test_pictures_are_taken_every_few_cycles_and_of_each_new_mode_at_once() -> None:
    assert SETTINGS.world is not None
    records: list[CycleRecord] = []
    run = simulate(SETTINGS, SETTINGS.world, 0, 2.0, lambda record, _truth: records.append(record))
    shown = View(SETTINGS, Console(file=io.StringIO()), "m")
    driver, stats, taken = make_driver(SETTINGS), CycleStats(0.005), 0
    for record in records:
        shown.on_cycle(record, run.state, stats, driver)
        taken += shown._slot is not None
        shown._slot = None
    modes = [None, *(record.mode.mode for record in records)]
    new = {k for k in range(len(records)) if modes[k + 1] is not modes[k]}
    due = {k for k in range(len(records)) if records[k].cycle % EVERY_CYCLES == 0}
    assert len(new) >= 2
    assert taken == len(new | due)


def test_a_pause_is_shown_at_once(terminal: Terminal) -> None:
    shown = terminal.view
    shown._slot = EMPTY
    with shown.shown():
        shown.draw_again()
        terminal.until("CONNECTING")
        assert "PAUSED" not in terminal.text
        shown.is_paused = lambda: True
        shown.draw_again()
        terminal.until("PAUSED")


def test_the_reason_why_the_robot_holds_is_shown() -> None:
    assert SETTINGS.world is not None
    records: list[CycleRecord] = []
    run = simulate(SETTINGS, SETTINGS.world, 0, 2.0, lambda record, _truth: records.append(record))
    run.state.hold_reason = "the goal is reached"
    shown = View(SETTINGS, Console(file=io.StringIO()), "m")
    for record in records[:EVERY_CYCLES]:
        shown.on_cycle(record, run.state, CycleStats(0.005), make_driver(SETTINGS))
    assert shown._slot is not None
    assert shown._slot.reason == "the goal is reached"


def test_quantiles_are_computed_once_a_second_and_at_the_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    """After an hour they take milliseconds of the interpreter, for which a cycle might wait."""
    stats, computed = CycleStats(0.005), list[int]()
    shown = View(SETTINGS, Console(file=io.StringIO()), "m")
    shown._stats = stats
    quantiles = stats.cycle_us

    def counted() -> Quantiles:
        computed.append(stats.cycles)
        return quantiles()

    monkeypatch.setattr(stats, "cycle_us", counted)
    every = round(QUANTILES_PERIOD_S * SETTINGS.cycle.rate_hz)
    for _ in range(3 * every + 1):
        stats.add_cycle(0.001 * (stats.cycles + 1))
        shown._completed(EMPTY)
    assert computed == [*range(1, every), 2 * every - 1, 3 * every - 1]
    shown._done = True
    shown_us = shown._completed(EMPTY).cycle_us
    assert shown_us["max"] == pytest.approx(1e3 * stats.cycles)


async def test_a_snapshot_is_taken_when_the_cycle_has_ended() -> None:
    cycle: Any = ("record", "state", "stats", "driver")
    taken: list[Any] = []
    after_each_cycle(lambda *given: taken.append(given))(*cycle)
    assert taken == []
    await asyncio.sleep(0.0)
    assert taken == [cycle]
