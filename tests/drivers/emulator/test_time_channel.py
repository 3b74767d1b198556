"""The emulator's end of the control of time: time scales received, followed and acknowledged."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.emulator.time_channel import TimeChannel, TimeScaleFollower
from drivers.emulator.time_scale import MESSAGE_MAX, REAL_TIME, TimeScale


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
def test_a_malformed_message_is_refused_and_changes_nothing(line: bytes) -> None:
    follower = TimeScaleFollower()
    follower.receive(line + b"\n")
    assert follower.scale == REAL_TIME
    out = follower.acknowledge(5.0)
    assert out.startswith(b"refused ")
    assert out.count(b"\n") == 1


@given(st.binary(max_size=2000), st.integers(1, 64))
def test_any_bytes_are_accepted_in_any_chunks_and_few_are_kept(data: bytes, size: int) -> None:
    follower = TimeScaleFollower()
    for at in range(0, len(data), size):
        follower.receive(data[at : at + size])
        assert len(follower._rest) <= MESSAGE_MAX + 1 + size
    follower.receive(b"\ntime_scale 7 0 0 2 1\n")
    assert b"acknowledged 7 " in follower.acknowledge(1.0)


def test_a_time_scale_is_acknowledged_once_and_real_time_is_silent() -> None:
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
