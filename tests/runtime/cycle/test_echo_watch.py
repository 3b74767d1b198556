"""A ring that never hears an echo stops the robot once, before it has driven far; one echo ends the watch."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from config.load import load_settings
from config.world import WorldConfig
from drivers.emulator.faults import SilentRing
from drivers.messages import Firing, Flags, Odometry, Pose, Twist
from runtime.cycle.echo_watch import (
    LINE_MIN_M,
    NOTHING_NEW,
    NOTHING_SO_FAR,
    NOTHING_YET,
    OPEN_M,
    WAY_MIN_M,
    EchoWatch,
)
from runtime.cycle.inputs import Request
from runtime.cycle.modes import Mode
from tests.runtime.emulated_run import Run

TOUCH_M_S = 0.05


def at(x_m: float, theta: float = 0.0) -> Odometry:
    return Odometry(x_m, Pose(x_m, 0.0, theta), theta, Twist(0.3, 0.0), Flags.NONE, 0)


def heard(*ranges_m: float) -> tuple[Firing, ...]:
    return (Firing(0.0, Pose(0.0, 0.0, 0.0), 0.0, np.array(ranges_m)),)


def test_silence_counts_while_the_robot_drives_and_is_named_once() -> None:
    watch = EchoWatch()
    for k in range(11):
        watch, reason = watch.observe(at(0.1 * k), heard(math.inf, math.nan)).stopped(4.0)
        assert (reason is None) is (k < 10)
    assert reason is not None
    assert "no sensor has heard an echo since the start, over 1.0 m" in reason
    assert watch.observe(at(9.0), heard(math.inf)).stopped(4.0)[1] is None, "armed again it drives on"


def test_a_ring_that_reaches_less_is_slow_and_not_stopped() -> None:
    watch = EchoWatch()
    for k in range(60):
        watch, reason = watch.observe(at(0.1 * k), heard(math.inf)).stopped(1.5)
        assert reason is None
        assert watch.slow_reason == (NOTHING_YET if watch.way_m < WAY_MIN_M else NOTHING_SO_FAR)
        is_open = watch.armed().slow_reason is None
        assert is_open is (watch.way_m >= WAY_MIN_M), "an operator has seen that it is in the open"
    assert watch.armed().observe(at(6.0), heard(math.inf)).slow_reason is None


def test_what_a_robot_touches_in_the_open_it_has_not_heard() -> None:
    watch = EchoWatch(way_m=WAY_MIN_M)
    assert watch.touched().armed().slow_reason == watch.armed().touched().slow_reason == NOTHING_YET
    hears = EchoWatch().observe(at(0.0), heard(2.0))
    assert hears.touched() == hears


def test_a_contact_in_a_long_silence_does_not_forget_that_the_ring_has_heard() -> None:
    watch = EchoWatch(is_over=True, way_m=OPEN_M, longest_m=1.5, at=Pose(0.0, 0.0, 0.0))
    assert watch.slow_reason == NOTHING_NEW
    assert watch.armed().slow_reason is None
    assert watch.armed().touched().slow_reason == NOTHING_NEW


def test_a_ring_may_be_deaf_until_its_first_echo() -> None:
    assert EchoWatch().slow_reason == NOTHING_YET
    assert EchoWatch().observe(at(0.0), heard(2.0)).slow_reason is None


@pytest.mark.parametrize("repeated_m", [math.inf, 2.0])
def test_a_long_way_without_a_new_echo_later_is_slow_and_a_line_and_no_stop(repeated_m: float) -> None:
    """The ring is silent, or frozen: with old echoes it is slow from the line on."""
    watch, lines = EchoWatch().observe(at(0.0), heard(2.0)), list[str | None]()
    for k in range(60):
        watch, reason = watch.observe(at(0.1 * k), heard(repeated_m), hears_new=False).stopped(4.0)
        assert reason is None
        is_slow = watch.way_m >= OPEN_M or math.isfinite(repeated_m)
        assert watch.slow_reason == (watch.silence if is_slow else None)
        assert (watch.silence is None) is (k < round(10.0 * LINE_MIN_M))
        lines.append(watch.silence)
    assert (lines.index(NOTHING_NEW), len(set(lines))) == (round(10.0 * OPEN_M), 3)
    assert watch.way_m == OPEN_M
    assert watch.observe(at(6.0), heard(2.0)).silence is None
    assert watch.armed().slow_reason is watch.armed().silence is None, "an operator has seen where it stands"
    assert watch.armed().observe(at(6.0), heard(2.0)) == watch.observe(at(6.0), heard(2.0))
    assert EchoWatch().armed() == EchoWatch(), "it has yet to hear its first echo"


def test_only_a_silence_that_is_longer_than_all_before_is_a_line() -> None:
    watch, lines = EchoWatch().observe(at(0.0), heard(2.0)), set[str]()
    for silence_m in (0.3, 0.7, 1.3, 0.9, 1.5, 3.1, 3.9, 3.9):
        for k in range(round(10.0 * silence_m) + 1):
            watch = watch.observe(at(0.1 * k), heard(math.inf))
            is_new = watch.silence is not None and watch.silence not in lines
            lines |= {watch.silence} if watch.silence is not None else set()
            assert not is_new or silence_m in {0.7, 3.1}
        watch = watch.observe(at(0.0), heard(2.0))
        assert watch.silence is None
    assert len(lines) == 2
    assert all(any(f"over the last {way} m, in this run" in line for line in lines) for way in ("0.6", "3.0"))


@pytest.mark.parametrize("repeated_m", [math.inf, 2.0])
def test_a_robot_that_turns_to_and_fro_without_a_new_echo_gives_a_line(repeated_m: float) -> None:
    watch = EchoWatch().observe(at(0.0), heard(2.0))
    for k in range(1, 32):
        turn = 0.1 * abs((k + 10) % 20 - 10)
        watch = watch.observe(at(0.0, math.pi - 1.0 + turn), heard(repeated_m), hears_new=False)
    assert watch.silence is None
    for theta in (0.0, 0.5):
        watch = watch.observe(at(0.0, theta), heard(repeated_m), hears_new=False)
    assert watch.silence is not None
    assert watch.way_m == 0.0
    assert (watch.slow_reason is None) is math.isinf(repeated_m)
    assert (
        EchoWatch().observe(at(0.0), heard(math.inf)).observe(at(0.0, 3.0), heard(math.inf)).stopped(4.0)[1] is None
    )


def test_an_old_echo_at_the_beginning_of_a_silence_does_not_slow_the_robot_down() -> None:
    watch = EchoWatch().observe(at(0.0), heard(2.0))
    for k in range(12):
        watch = watch.observe(at(0.1 * k), heard(2.0 if k < 2 else math.inf), hears_new=False)
    assert watch.slow_reason is None
    assert watch.silence is not None
    assert watch.observe(at(1.2), heard(2.0), hears_new=False).slow_reason is not None, "it is heard to the end"


@pytest.mark.compiled
def test_an_honest_ring_of_little_reach_drives_on_in_the_middle_of_a_room() -> None:
    settings = load_settings("room", robot="servo1")
    assert settings.world is not None
    run = Run(settings, settings.world, 1, preparing="left out")
    run.until_true(lambda: run.state.echo_watch.is_over, 60.0)
    assert run.mode is Mode.DRIVE
    assert run.state.echo_watch.way_m == 0.0, "it has heard an echo"


def test_an_echo_ends_the_watch_and_cycles_without_firings_do_not_count() -> None:
    watch = EchoWatch().observe(at(0.0), heard(math.inf, 2.0))
    assert watch.observe(at(5.0), heard(math.inf)).stopped(4.0)[1] is None
    assert EchoWatch().observe(at(0.0), ()).observe(at(9.0), ()).way_m == 0.0
    assert EchoWatch().observe(None, heard(math.inf)).way_m == 0.0


@pytest.mark.compiled
@pytest.mark.parametrize("robot", [pytest.param("servo1", marks=pytest.mark.soak), "denning"])
def test_a_ring_that_never_hears_stops_the_robot_before_it_touches(
    robot: str, measured: Callable[[str], None]
) -> None:
    """As with a 5 V echo on a pin of 3.3 V. A ring of little reach is slow until the robot stops at a contact."""
    settings = load_settings("room", robot=robot)
    assert settings.world is not None
    silent = SilentRing(kind="silent_ring", at_s=0.0, duration_s=1e3)
    run = Run(settings, settings.world, 1, (silent,), preparing="left out")
    while run.mode is not Mode.SAFE_STOP:
        run.cycle()
        assert run.run_s < 120.0
        assert run.truths[-1].contact_m_s <= TOUCH_M_S
    assert "ring-test --hand" in str(run.state.mode.reason) or robot == "servo1"
    measured(f"{robot} that never hears an echo: stopped after {run.run_s:.1f} s")


@pytest.mark.compiled
def test_in_the_open_a_robot_that_is_armed_again_drives_on() -> None:
    run = Run(load_settings("room", robot="denning"), WorldConfig(), 1, preparing="left out")

    def drives() -> bool:
        return run.mode is Mode.DRIVE

    run.until_true(drives, 5.0)
    run.until_true(lambda: not drives(), 30.0)
    before = run.truths[-1].pose.x
    run.until_true(drives, 5.0, Request.ARM)
    run.until(run.run_s + 10.0)
    assert drives()
    assert run.truths[-1].pose.x > before + 2.0 * WAY_MIN_M
