"""The emulator's time under a law: what a line says, what is obeyed, and what is told about it."""

from __future__ import annotations

import contextlib
import math
import os
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.emulator.time_channel import ControlChannel, Governor
from drivers.emulator.time_scale import FACTOR_MAX, FACTOR_MIN, LINE_MAX, REAL, TimeScale, pace_in

TIMES = st.floats(-1e6, 1e9)
PACES = st.builds(TimeScale, TIMES, TIMES, st.floats(FACTOR_MIN, FACTOR_MAX), st.one_of(TIMES, st.just(math.inf)))


@given(PACES, st.integers(0, 10**6))
def test_a_law_comes_through_a_line_to_the_bit(pace: TimeScale, number: int) -> None:
    line = pace.line(number)
    assert len(line) <= LINE_MAX
    assert pace_in(line) == (number, pace)


@given(st.floats(0.0, 1e9))
def test_real_time_is_the_host_s_to_the_bit(host_s: float) -> None:
    assert REAL.at(host_s) == host_s


@given(PACES, st.lists(TIMES, min_size=2))
def test_time_never_goes_back_nor_beyond_its_end(pace: TimeScale, moments: list[float]) -> None:
    shown = [pace.at(host_s) for host_s in sorted(moments)]
    assert shown == sorted(shown)
    assert max(shown) <= pace.until_s


def test_when_a_time_comes() -> None:
    pace = TimeScale(10.0, 100.0, 4.0, 102.0)
    assert pace.host_at(102.0) == 10.5
    assert pace.at(10.5) == 102.0
    assert pace.at(99.0) == 102.0
    assert pace.host_at(102.1) == math.inf


@pytest.mark.parametrize(
    "line",
    [b"pace", b"pace 1 0 0 1", b"pace x 0 0 1 inf", b"pace 1 nan 0 1 inf", b"pace 1 0 inf 1 inf", b"pace 1 0 0 0 inf",
     b"pace 1 0 0 11 inf", b"pace 1 0 0 1 nan", b"rate 1 0 0 1 inf", b"\xff\x00", b"pace 1 0 0 1 inf more",
     b"pace 1 " + b"0" * LINE_MAX + b" 0 1 inf"],
)  # fmt: skip
def test_what_is_no_law_is_refused_and_changes_nothing(line: bytes) -> None:
    governor = Governor()
    governor.take(line + b"\n")
    assert governor.pace == REAL
    out = governor.lived(5.0)
    assert out.startswith(b"refused ")
    assert out.count(b"\n") == 1


@given(st.binary(max_size=2000), st.integers(1, 64))
def test_any_bytes_are_taken_in_any_chunks_and_little_is_kept(data: bytes, size: int) -> None:
    governor = Governor()
    for at in range(0, len(data), size):
        governor.take(data[at : at + size])
        assert len(governor._rest) <= LINE_MAX + 1 + size
    governor.take(b"\npace 7 0 0 2 1\n")
    assert b"at 7 " in governor.lived(1.0)


def test_a_law_is_answered_once_and_free_time_is_silent() -> None:
    governor = Governor()
    assert governor.lived(1.0) == b""
    governor.take(b"pace 3 0.0 0.0 1.0 inf\n")
    assert governor.lived(1.0) == b"at 3 1.0\n"
    assert governor.lived(1.5) == b""


def test_a_robot_that_has_lived_on_stands_where_it_is() -> None:
    governor = Governor()
    governor.lived(10.02)
    governor.take(TimeScale(0.0, 0.0, 1.0, 10.0).line(1))
    assert governor.now_s(99.0) == 10.02
    assert governor.lived(10.02) == b"at 1 10.02\n"
    assert governor.lived(10.02) == b""


def test_what_is_lived_in_held_time_is_told_as_it_goes() -> None:
    governor = Governor()
    governor.lived(10.0)
    governor.take(TimeScale(50.0, 10.0, 2.0, 10.5).line(4))
    told = [governor.lived(governor.now_s(host_s)) for host_s in (50.125, 50.1875, 50.25, 50.3)]
    assert told == [b"at 4 10.25\n", b"at 4 10.375\n", b"at 4 10.5\n", b""]


def test_held_time_goes_on_where_nobody_holds_it_any_more() -> None:
    governor = Governor()
    governor.lived(10.0)
    governor.take(TimeScale(0.0, 0.0, 1.0, 10.0).line(1))
    governor.release(60.0)
    assert governor.now_s(60.0) == 10.0
    assert governor.now_s(61.5) == 11.5


@pytest.fixture
def pipes() -> Iterator[tuple[int, int, int, int]]:
    """Give what the program reads and writes, and what its controller writes and reads."""
    inside, outside = os.pipe(), os.pipe()
    yield inside[0], outside[1], inside[1], outside[0]
    for fd in {*inside, *outside}:
        with contextlib.suppress(OSError):
            os.close(fd)


def test_over_pipes_nobody_waits(pipes: tuple[int, int, int, int]) -> None:
    reads, writes, theirs, answers = pipes
    channel = ControlChannel(reads, writes)
    channel.listen(1.0)
    os.write(theirs, TimeScale(1.0, 1.0, 1.0, 2.0).line(1))
    channel.listen(1.0)
    channel.lived(1.5)
    assert os.read(answers, 100) == b"at 1 1.5\n"
    for n in range(20_000):
        channel.lived(2.0 + 1e-6 * n)
    os.close(theirs)
    channel.listen(3.0)
    assert channel.governor.pace.is_free
    assert channel.governor.now_s(4.0) == pytest.approx(channel.governor.now_s(3.0) + 1.0)
    channel.close()
    assert os.get_blocking(reads)
