"""Tests of the live view: what it shows, how often, and that it leaves the terminal as it was."""

from __future__ import annotations

import asyncio
import contextlib
import io
import os
import pty
import signal
import sys
import termios
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from config.load import load_settings
from drivers.messages import Floats, LinkCounts, Pose, Twist
from drivers.registry import make_driver
from perception.detected_object import DetectedObject, MapCounts
from perception.localization.drift_correction import LocalizedPose
from runtime.cli.terminal.view import EVERY_CYCLES, SWITCH_INTERVAL_S, Snapshot, View, keys
from runtime.cycle.inputs import Request
from runtime.cycle.modes import Mode, ModeState
from runtime.cycle.step import CycleRecord
from runtime.simulation.closed_loop import simulate
from runtime.timing.cycle_stats import CycleStats

SETTINGS = load_settings("hallway")
NO_SEGMENTS: Floats = np.zeros((0, 5))
EMPTY = Snapshot(
    ModeState(), None, [], NO_SEGMENTS, MapCounts(0, 0, 0), (), np.full(24, np.nan), LinkCounts(), 0, 0,
    {"p50": 0.0, "p99": 0.0, "max": 0.0}, {"p50": 0.0, "p99": 0.0, "max": 0.0},
)  # fmt: skip


def seen(x: float, y: float, model: str = "semicircle") -> DetectedObject:
    return DetectedObject(model, x, y, 0.5, 0.01, 39, 0.9)


def printed(snapshot: Snapshot, width: int = 100, height: int = 50, url: str | None = None) -> str:
    console = Console(record=True, width=width, height=height, file=io.StringIO(), color_system=None)
    view = View(SETTINGS, console, "ft")
    view.console_url = url
    console.print(view.picture(snapshot))
    return console.export_text()


@pytest.mark.parametrize("width", [1, 2, 20, 30, 80, 250])
def test_before_the_first_odometry_there_is_a_picture(width: int) -> None:
    text = printed(EMPTY, width)
    assert "CONNECTING" in text or width < 20
    if width >= 80:
        assert "waiting for odometry" in text
        assert "0 frames, 0 bad, 0 lost" in text
        assert "·" * 24 in text


def test_a_picture_shows_mode_reason_objects_ring_and_numbers() -> None:
    snapshot = replace(
        EMPTY,
        mode=ModeState(Mode.SAFE_STOP, 1.0, "bumper contact: free the robot, then re-arm"),
        pose=Pose(1.0, 0.0, 0.0), trail=[(0.0, 0.0)], segments=np.array([[0.9, 1.0, 1.1, 1.0, 0.0]]),
        map_counts=MapCounts(1, 1, 7, 12, 3),
        objects=(seen(0.3048, 1.2192),),
        ranges=np.array([np.nan, np.inf, 0.0, SETTINGS.ring.range_max_m] + [1.0] * 20),
        counts=LinkCounts(1832, 3, 2), cycles=520, late=9,
        cycle_us={"p50": 478.0, "p99": 2961.0, "max": 5958.0}, lag_us={"p50": 907.0, "p99": 5415.0, "max": 8954.0},
        missed=4, faults=(("refine", 2), ("outside the process", 7)),
    )  # fmt: skip
    text = printed(snapshot)
    for piece in (
        "SAFE STOP", "bumper contact: free the robot", "→", "•",
        "1 segments, 7 hypotheses, 12 objects left behind; 3 near objects wait for room",
        "1832 frames, 3 bad, 2 lost",
        "520, 9 late, 4 missed", "outside the process: 7, refine: 2",
        "0.48 ms (p99 2.96)", "0.91 ms (p99 5.42)", "semicircle", "1.00", "4.00", "··█▁",
    ):  # fmt: skip
        assert piece in text, piece


URL = "http://127.0.0.1:8374/?token=qT3xYw0s1uBhVJYkz0cH4nR2mFpL8dXe"
BUSY = replace(
    EMPTY,
    mode=ModeState(Mode.SAFE_STOP, 1.0, "no echoes for 0.6 s: check the ring's power and cable; then re-arm"),
    pose=Pose(1.0, 0.0, 0.0), trail=[(0.1 * k, 0.0) for k in range(40)],
    segments=np.array([[0.9, 1.0 + 0.1 * k, 1.1, 1.0, 0.0] for k in range(30)]), map_counts=MapCounts(304, 9, 7),
    objects=(
        DetectedObject("semicircle", -1.005, 1.2192, 0.5, 0.0123, 39, 0.999, 0.999, number=3),
        DetectedObject("wall", 3.0, 2.0, 0.0, 0.9, 50, 0.97, 0.97, (3.0, 0.0, 0.0), 12, sigma_theta=0.01),
        *(DetectedObject("post", 0.2 * k, 3.0, 0.0, 0.02, 12, 0.8, 0.8, number=20 + k) for k in range(14)),
    ),
    sensors=("sensor 4 has been silent for 30 s", "sensor 9 repeats 0.91 m"), counts=LinkCounts(1832, 3, 2),
    cycles=520, late=9, faults=(("refine", 2),), twist=Twist(-0.2, -0.1),
)  # fmt: skip


@pytest.mark.promise("P31")
@pytest.mark.parametrize("size", [(80, 24), (120, 40), (200, 60), (40, 16), (100, 10)])
def test_what_a_person_needs_fits_the_terminal(size: tuple[int, int]) -> None:
    width, height = size
    lines = printed(BUSY, width, height, URL).rstrip("\n").split("\n")
    assert len(lines) < height, "nothing scrolls away"
    assert max(map(len, lines)) <= width
    assert lines[0].startswith(" SAFE STOP  −0.66 ft/s ↻ 6°/s")
    assert "no ech" in f"{lines[0]}{lines[1]}"
    assert URL in "".join(line.rstrip() for line in lines)
    assert any("space halt" in line or "␣ halt" in line for line in lines)
    assert sum(line.startswith("masked") for line in lines) == 2
    if height > 10:
        assert any("3 semicircle" in line and "> 99 %" in line for line in lines)
    if height >= 24:
        assert "check the ring's power and cable; then re-arm" in " ".join(lines[:2]), "with the action"
        assert any("20 post" in line and "hidden" in line for line in lines), "the wall is between"
        text = "\n".join(lines)
        for piece in (
            "objects  15, and 1 wall", "−3.30, 4.00 ft, 29°  ", "± 0.040 ft", "0.00, 6.56 to 19.69, 6.56 ft",
            "19.69 ft long", "1832 frames, 3 bad, 2 lost", "304 segments", "refine: 2",
        ):  # fmt: skip
            assert piece in text, piece
        assert ("→" in text) == (height > 24 or "have no room" not in text)


@pytest.mark.parametrize("size", [(0, 0), (1, 1), (20, 5), (5, 20), (80, 2)])
def test_no_size_is_too_small(size: tuple[int, int]) -> None:
    width, height = size
    text = printed(BUSY, width, height, URL).rstrip("\n")
    assert len(text.split("\n")) <= max(1, height - 1)
    if size == (20, 5):
        assert text.startswith(" SAFE STOP")


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def until(done: Callable[[], bool]) -> None:
    end_s = time.monotonic() + 60.0
    while not done():
        assert time.monotonic() < end_s, "timed out"
        time.sleep(0.005)


def test_the_place_in_the_map_is_shown_and_that_it_is_unknown() -> None:
    assert "place" not in printed(EMPTY)
    unknown = LocalizedPose(Pose(0.0, 0.0, 0.0), 0.0, np.diag([np.inf] * 3), "lost", 0.02)
    assert "unknown, lost 2 %" in printed(replace(EMPTY, localized=unknown))
    known = LocalizedPose(Pose(3.048, 0.3048, np.pi), 0.0, np.diag([4e-4, 1e-4, 1e-4]), "tracking", 0.97)
    assert "10.00, 1.00 ± 0.066 ft, 180° ± 0.6°, tracking 97 %" in printed(replace(EMPTY, localized=known))


def test_a_drive_is_drawn_by_the_thread_and_the_loop_never_waits_for_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm")
    assert SETTINGS.world is not None
    records: list[CycleRecord] = []
    run = simulate(SETTINGS, SETTINGS.world, 0, 8.0, lambda record, _truth: records.append(record))
    file = Terminal()
    view = View(SETTINGS, Console(file=file, width=100, force_terminal=True), "m")
    driver, stats = make_driver(SETTINGS), CycleStats(0.005)
    before_s = sys.getswitchinterval()
    with view.shown():
        assert sys.getswitchinterval() == pytest.approx(SWITCH_INTERVAL_S, abs=1e-6)
        for record in records:
            stats.add_cycle(0.001)
            view.on_cycle(record, run.state, stats, driver)
        until(lambda: "DRIVE" in file.getvalue())
    assert sys.getswitchinterval() == pytest.approx(before_s)
    until(lambda: all(thread.name != "view" for thread in threading.enumerate()))
    assert "outline segments" in file.getvalue()


def test_pictures_are_taken_every_few_cycles_only() -> None:
    assert SETTINGS.world is not None
    records: list[CycleRecord] = []
    run = simulate(SETTINGS, SETTINGS.world, 0, 2.0, lambda record, _truth: records.append(record))
    view = View(SETTINGS, Console(file=io.StringIO()), "m")
    driver, stats, taken = make_driver(SETTINGS), CycleStats(0.005), 0
    for record in records:
        view.on_cycle(record, run.state, stats, driver)
        taken += view._slot is not None
        view._slot = None
    assert taken == len(records) // EVERY_CYCLES


def test_a_pause_is_shown_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm")
    file = Terminal()
    view = View(SETTINGS, Console(file=file, width=100, force_terminal=True), "m")
    view._slot = EMPTY
    with view.shown():
        view.draw_again()
        until(lambda: "CONNECTING" in file.getvalue())
        assert "PAUSED" not in file.getvalue()
        view.is_paused = lambda: True
        view.draw_again()
        until(lambda: "PAUSED" in file.getvalue())


def test_the_reason_why_the_robot_holds_is_shown() -> None:
    assert SETTINGS.world is not None
    records: list[CycleRecord] = []
    run = simulate(SETTINGS, SETTINGS.world, 0, 2.0, lambda record, _truth: records.append(record))
    run.state.hold_reason = "the goal is reached"
    view = View(SETTINGS, Console(file=io.StringIO()), "m")
    for record in records[:EVERY_CYCLES]:
        view.on_cycle(record, run.state, CycleStats(0.005), make_driver(SETTINGS))
    assert view._slot is not None
    assert view._slot.mode.reason == "the goal is reached"


@pytest.fixture
def keyboard(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    master, slave = pty.openpty()
    with contextlib.ExitStack() as stack:
        stack.callback(os.close, master)
        monkeypatch.setattr(sys, "stdin", stack.enter_context(os.fdopen(slave, "r")))
        yield master


async def test_keys_arm_halt_and_quit_and_leave_the_terminal_as_it_was(keyboard: int) -> None:
    before = termios.tcgetattr(sys.stdin.fileno())
    asked: list[Request] = []
    quits = asyncio.Event()
    with keys(asked.append, quits.set):
        os.write(keyboard, b"ax h")
        async with asyncio.timeout(60.0):
            while len(asked) < 3:  # keys that came together are all taken at once
                await asyncio.sleep(0.01)
        os.write(keyboard, b"q")
        await asyncio.wait_for(quits.wait(), 60.0)
    assert asked == [Request.ARM, Request.HALT, Request.HALT]
    assert termios.tcgetattr(sys.stdin.fileno()) == before


async def test_after_it_was_stopped_and_continued_it_takes_keys_again(
    keyboard: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A shell sets its own mode of the terminal while the program is stopped."""
    fd = sys.stdin.fileno()
    line_mode, is_in_front = termios.tcgetattr(fd), False
    monkeypatch.setattr(os, "tcgetpgrp", lambda _fd: os.getpgrp() if is_in_front else -1)
    asked: list[Request] = []
    with keys(asked.append, lambda: None):
        termios.tcsetattr(fd, termios.TCSANOW, line_mode)
        os.kill(os.getpid(), signal.SIGCONT)
        await asyncio.sleep(0.05)
        assert termios.tcgetattr(fd)[3] & termios.ICANON
        is_in_front = True
        os.kill(os.getpid(), signal.SIGCONT)
        os.write(keyboard, b" ")
        async with asyncio.timeout(60.0):
            while not asked:
                await asyncio.sleep(0.01)
    assert asked == [Request.HALT]
    assert termios.tcgetattr(fd) == line_mode


async def test_without_a_terminal_there_are_no_keys(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "in").write_text("qqq")
    with (tmp_path / "in").open() as file:
        monkeypatch.setattr(sys, "stdin", file)
        asked: list[Request] = []
        with keys(asked.append, lambda: asked.append(Request.HALT)):
            await asyncio.sleep(0)
        assert asked == []
