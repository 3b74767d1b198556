"""The emulator's time under a law: what a line says, what is obeyed, and what is reported about it."""

from __future__ import annotations

import contextlib
import math
import os
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.emulator.time_channel import TimeChannel, TimeScaleFollower
from drivers.emulator.time_scale import FACTOR_MAX, FACTOR_MIN, MESSAGE_MAX, REAL_TIME, TimeScale, parse_time_scale

TIMES = st.floats(-1e6, 1e9)
SCALES = st.builds(TimeScale, TIMES, TIMES, st.floats(FACTOR_MIN, FACTOR_MAX), st.one_of(TIMES, st.just(math.inf)))


@given(SCALES, st.integers(0, 10**6))
def test_a_law_comes_through_a_line_to_the_bit(scale: TimeScale, number: int) -> None:
    line = scale.encode(number)
    assert len(line) <= MESSAGE_MAX
    assert parse_time_scale(line) == (number, scale)


@given(st.floats(0.0, 1e9))
def test_real_time_is_the_host_s_to_the_bit(host_s: float) -> None:
    assert REAL_TIME.run_at(host_s) == host_s


@given(SCALES, st.lists(TIMES, min_size=2))
def test_time_never_goes_back_nor_beyond_its_end(scale: TimeScale, moments: list[float]) -> None:
    shown = [scale.run_at(host_s) for host_s in sorted(moments)]
    assert shown == sorted(shown)
    assert max(shown) <= scale.until_s


def test_when_a_time_comes() -> None:
    scale = TimeScale(10.0, 100.0, 4.0, 102.0)
    assert scale.host_at(102.0) == 10.5
    assert scale.run_at(10.5) == 102.0
    assert scale.run_at(99.0) == 102.0
    assert scale.host_at(102.1) == math.inf


@pytest.mark.parametrize(
    "line",
    [
        b"time_scale",
        b"time_scale 1 0 0 1",
        b"time_scale x 0 0 1 inf",
        b"time_scale 1 nan 0 1 inf",
        b"time_scale 1 0 inf 1 inf",
        b"time_scale 1 0 0 0 inf",
        b"time_scale 1 0 0 11 inf",
        b"time_scale 1 0 0 1 nan",
        b"rate 1 0 0 1 inf",
        b"\xff\x00",
        b"time_scale 1 0 0 1 inf more",
        b"time_scale 1 " + b"0" * MESSAGE_MAX + b" 0 1 inf",
    ],
)
def test_what_is_no_law_is_refused_and_changes_nothing(line: bytes) -> None:
    follower = TimeScaleFollower()
    follower.receive(line + b"\n")
    assert follower.scale == REAL_TIME
    out = follower.acknowledge(5.0)
    assert out.startswith(b"refused ")
    assert out.count(b"\n") == 1


@given(st.binary(max_size=2000), st.integers(1, 64))
def test_any_bytes_are_taken_in_any_chunks_and_little_is_kept(data: bytes, size: int) -> None:
    follower = TimeScaleFollower()
    for at in range(0, len(data), size):
        follower.receive(data[at : at + size])
        assert len(follower._rest) <= MESSAGE_MAX + 1 + size
    follower.receive(b"\ntime_scale 7 0 0 2 1\n")
    assert b"acknowledged 7 " in follower.acknowledge(1.0)


def test_a_law_is_answered_once_and_free_time_is_silent() -> None:
    follower = TimeScaleFollower()
    assert follower.acknowledge(1.0) == b""
    follower.receive(b"time_scale 3 0.0 0.0 1.0 inf\n")
    assert follower.acknowledge(1.0) == b"acknowledged 3 1.0\n"
    assert follower.acknowledge(1.5) == b""


def test_robot_ahead_of_the_scale_waits() -> None:
    follower = TimeScaleFollower()
    follower.acknowledge(10.02)
    follower.receive(TimeScale(0.0, 0.0, 1.0, 10.0).encode(1))
    assert follower.run_at(99.0) == 10.02
    assert follower.acknowledge(10.02) == b"acknowledged 1 10.02\n"
    assert follower.acknowledge(10.02) == b""


def test_time_run_while_held_is_acknowledged() -> None:
    follower = TimeScaleFollower()
    follower.acknowledge(10.0)
    follower.receive(TimeScale(50.0, 10.0, 2.0, 10.5).encode(4))
    reported = [follower.acknowledge(follower.run_at(host_s)) for host_s in (50.125, 50.1875, 50.25, 50.3)]
    assert reported == [b"acknowledged 4 10.25\n", b"acknowledged 4 10.375\n", b"acknowledged 4 10.5\n", b""]


def test_held_time_goes_on_where_no_one_holds_it_any_more() -> None:
    follower = TimeScaleFollower()
    follower.acknowledge(10.0)
    follower.receive(TimeScale(0.0, 0.0, 1.0, 10.0).encode(1))
    follower.release(60.0)
    assert follower.run_at(60.0) == 10.0
    assert follower.run_at(61.5) == 11.5


@pytest.fixture
def pipes() -> Iterator[tuple[int, int, int, int]]:
    """Give what the program reads and writes, and what its controller writes and reads."""
    inside, outside = os.pipe(), os.pipe()
    yield inside[0], outside[1], inside[1], outside[0]
    for fd in {*inside, *outside}:
        with contextlib.suppress(OSError):
            os.close(fd)


def test_over_pipes_no_one_waits(pipes: tuple[int, int, int, int]) -> None:
    reads, writes, theirs, answers = pipes
    channel = TimeChannel(reads, writes)
    channel.receive(1.0)
    os.write(theirs, TimeScale(1.0, 1.0, 1.0, 2.0).encode(1))
    channel.receive(1.0)
    channel.acknowledge(1.5)
    assert os.read(answers, 100) == b"acknowledged 1 1.5\n"
    for n in range(20_000):
        channel.acknowledge(2.0 + 1e-6 * n)
    os.close(theirs)
    channel.receive(3.0)
    assert channel.follower.scale.is_real_time
    assert channel.follower.run_at(4.0) == pytest.approx(channel.follower.run_at(3.0) + 1.0)
    channel.close()
    assert os.get_blocking(reads)
