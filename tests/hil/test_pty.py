"""The emulator as a process of its own: a real pty, real time, and every way a host can treat it badly."""

from __future__ import annotations

import contextlib
import errno
import itertools
import json
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TypeVar

import pytest

from drivers.denning.codec import Decoder, encode
from drivers.denning.frames import Ack, Drive, Echo, Frame, Hello, Ident, Odom, Pattern
from drivers.emulator.pty_transport import LAG_MAX_S, LINGER_S, EmulatorError, PtyPort, SlippingClock
from drivers.emulator.truth_trace import HEADER
from tests.hil.machine import TIMEOUT_S, AnyTest, stalls_excused

F = TypeVar("F", bound=Frame)
ROOT = Path(__file__).parents[2]


def in_real_time(test: AnyTest) -> AnyTest:
    """Mark a test whose emulator is to keep the time: with kernels compiled, and not with kernels slowed down."""
    marked: AnyTest = pytest.mark.realtime(pytest.mark.usefixtures("warm_kernels")(test))
    return marked


PROGRAM = """
import asyncio, json, sys
from config.robot import RobotConfig
from config.world import WorldConfig
from drivers.emulator.faults import FaultScript
from drivers.emulator.pty_transport import EmulatorError, serve
link, trace, baud, faults, orphan = json.loads(sys.argv[1])
robot = RobotConfig.model_validate({
    "ring": {"count": 24, "radius_m": 0.381, "beam_half_angle_deg": 12.0, "resolution_m": 0.03048,
             "range_min_m": 0.1524, "range_max_m": 7.7724},
    "body": {"radius_m": 0.381, "speed_max_m_s": 0.6, "turn_max_rad_s": 1.5},
    "link": {"baud": baud},
})
world = WorldConfig.model_validate({"wall": [{"x1_m": 90.0, "y1_m": -9.0, "x2_m": 90.0, "y2_m": 9.0}]})
def ready(path):
    sys.stdout.write(f"ready {path}\\n")
    sys.stdout.flush()
try:
    asyncio.run(serve(robot, world, link_path=link, faults=FaultScript.model_validate({"fault": faults}).fault,
                      seed=1, trace_path=trace, ready=ready, exit_with_parent=orphan))
except EmulatorError as error:
    sys.exit(str(error))
"""


def arguments(
    link: Path | None,
    *,
    trace: Path | None = None,
    baud: int = 115200,
    faults: list[dict[str, object]] | None = None,
    exit_with_parent: bool = False,
) -> list[str]:
    options = [link and str(link), trace and str(trace), baud, faults or [], exit_with_parent]
    return [sys.executable, "-c", PROGRAM, json.dumps(options)]


@contextlib.contextmanager
def emulator(command: list[str]) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """Run the program; yields it and the path it said it is ready on."""
    with subprocess.Popen(command, cwd=ROOT, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        try:
            word, _, path = process.stdout.readline().strip().partition(" ")
            assert word == "ready", process.communicate(timeout=TIMEOUT_S)[1]
            yield process, path
        finally:
            process.send_signal(signal.SIGCONT)
            process.kill()


class Host:
    """A plain file descriptor on the pty, and what was read from it."""

    def __init__(self, path: str) -> None:
        self.fd = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        # The emulator does not wait for a host: it may be in the middle of a frame.
        self.decoder = Decoder("robot", midway=True)
        self.heard: list[tuple[float, Frame]] = []
        self.bytes = 0

    def __enter__(self) -> Host:
        return self

    def __exit__(self, *_: object) -> None:
        os.close(self.fd)

    def send(self, *frames: Frame) -> None:
        os.write(self.fd, b"".join(map(encode, frames)))

    def pump(self, wait_s: float = 0.05) -> None:
        """Read what comes; raises OSError when the line is hung up."""
        if select.select([self.fd], [], [], wait_s)[0]:
            data = os.read(self.fd, 65536)
            if not data:
                raise OSError(errno.EIO, "hung up")
            self.bytes += len(data)
            now = time.monotonic()
            self.heard += [(now, frame) for frame in self.decoder.feed(data)]

    def of(self, kind: type[F]) -> list[F]:
        return [frame for _, frame in self.heard if isinstance(frame, kind)]

    def until(self, done: Callable[[], bool]) -> None:
        end = time.monotonic() + TIMEOUT_S
        while not done():
            assert time.monotonic() < end, "it never came"
            self.pump()


def wait_for(done: Callable[[], bool]) -> None:
    end = time.monotonic() + TIMEOUT_S
    while not done():
        assert time.monotonic() < end, "it never came"
        time.sleep(0.005)


def rows(trace: Path) -> list[dict[str, float]]:
    """Complete rows so far."""
    lines = trace.read_text().split("\n")[:-1]
    return [dict(zip(HEADER.split(","), map(float, line.split(",")), strict=True)) for line in lines[1:]]


@pytest.fixture
def link(tmp_path: Path) -> Path:
    return tmp_path / "robot"


@in_real_time
def test_it_answers_fires_and_ends_cleanly(link: Path) -> None:
    with emulator(arguments(link)) as (process, path):
        assert path == str(link)
        with Host(path) as host:
            host.send(Hello(0), Pattern(1, 50, 255, (1, 2, 4)))
            host.until(lambda: len(host.of(Echo)) >= 4 and len(host.of(Odom)) >= 10)
            assert host.of(Ident)[0].name == "denning"
            assert [ack.of for ack in host.of(Ack)] == [1]
            times = [odom.t_us for odom in host.of(Odom)]
            assert times == list(range(times[0], times[-1] + 1, 20_000))
            assert host.decoder.bad == 0
        process.send_signal(signal.SIGTERM)
        assert process.wait(TIMEOUT_S) == 0
        assert not link.is_symlink()
        assert process.communicate() == ("", "")


@in_real_time
@stalls_excused
def test_its_time_is_real_time(link: Path) -> None:
    with emulator(arguments(link)) as (_, path), Host(path) as host:
        host.until(lambda: len(host.of(Odom)) >= 80)
        (first, a), *_, (last, b) = [(when, f) for when, f in host.heard if isinstance(f, Odom)]
        assert last - first == pytest.approx((b.t_us - a.t_us) * 1e-6, abs=0.15)


@in_real_time
def test_without_a_link_it_prints_the_pty(link: Path) -> None:
    with emulator(arguments(None)) as (_, path), Host(path) as host:
        assert path.startswith("/dev/")
        assert not link.exists()
        host.until(lambda: len(host.of(Odom)) >= 1)


@in_real_time
def test_real_file_is_never_overwritten(link: Path) -> None:
    link.write_text("precious")
    done = subprocess.run(arguments(link), cwd=ROOT, text=True, capture_output=True, timeout=TIMEOUT_S, check=False)
    assert done.returncode == 1
    assert done.stdout == ""
    assert str(link) in done.stderr
    assert done.stderr.count("\n") == 1
    assert link.read_text() == "precious"


def test_stale_link_is_replaced_and_another_is_not(link: Path, tmp_path: Path) -> None:
    link.symlink_to("/dev/pts/123456")
    port = PtyPort(str(link))
    assert link.exists()
    port.close()
    assert not link.is_symlink()
    target = tmp_path / "precious"
    target.touch()
    link.symlink_to(target)
    with pytest.raises(EmulatorError, match="precious"):
        PtyPort(str(link))
    assert link.readlink() == target
    with pytest.raises(EmulatorError, match="cannot make the link"):
        PtyPort(str(tmp_path / "nowhere" / "robot"))


def test_link_of_a_successor_is_left_alone(link: Path) -> None:
    first = PtyPort(str(link))
    second = PtyPort(str(link))
    first.close()
    assert link.exists()
    second.close()
    assert not link.is_symlink()


@in_real_time
def test_hosts_come_and_go(link: Path) -> None:
    with emulator(arguments(link)) as (process, path):
        last_us = -1
        for seq in range(5):
            with Host(path) as host:
                host.send(Hello(seq))
                host.until(lambda host=host: bool(host.of(Ident)) and len(host.of(Odom)) > 3)  # type: ignore[misc]
                assert host.of(Odom)[0].t_us > last_us
                last_us = host.of(Odom)[-1].t_us
        assert process.poll() is None


@in_real_time
def test_last_words_of_a_host_are_heard(link: Path) -> None:
    with emulator(arguments(link)) as (_, path):
        with Host(path) as host:
            host.send(Pattern(0, 50, 255, (1,)))
        with Host(path) as host:
            host.until(lambda: len(host.of(Echo)) >= 2)


def test_what_a_host_left_unread_is_not_kept_for_the_next() -> None:
    port = PtyPort(None)
    first = os.open(port.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    assert port.read() == b""
    port.write(b"unread")
    os.close(first)
    assert port.read() is None
    second = os.open(port.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    assert port.read() == b""
    with pytest.raises(BlockingIOError):
        os.read(second, 100)
    os.close(second)
    port.close()


def test_host_that_does_not_read_blocks_nothing() -> None:
    port = PtyPort(None)
    host = os.open(port.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    sent = 0
    while port.dropped == 0:
        port.write(bytes(1000))
        sent += 1000
        assert sent < 10_000_000
    os.write(host, b"still heard")
    heard = b""
    while len(heard) < len(b"still heard"):
        heard += port.read() or b""
    assert heard == b"still heard"
    os.close(host)
    port.close()


@in_real_time
@stalls_excused
def test_emulator_outlives_a_host_that_does_not_read(link: Path, tmp_path: Path) -> None:
    flood: dict[str, object] = {"kind": "garbage", "at_s": 0.0, "duration_s": 1.0, "bytes_per_s": 150_000.0}
    trace = tmp_path / "truth.csv"
    with emulator(arguments(link, baud=2_000_000, faults=[flood], trace=trace)) as (_, path), Host(path) as host:
        wait_for(lambda: rows(trace)[-1:] != [] and rows(trace)[-1]["t_s"] > 1.5)
        host.until(lambda: any(odom.t_us > 1_500_000 for odom in host.of(Odom)))
        host.send(Hello(1))
        host.until(lambda: len(host.of(Ident)) == 1)
        assert host.bytes < 150_000, "unread output is not kept"


@in_real_time
@stalls_excused
def test_unplugging_hangs_up_and_plugging_in_links_again(link: Path) -> None:
    # Late and long enough for a host that comes slowly and looks seldom.
    unplug: dict[str, object] = {"kind": "unplug", "at_s": 2.0, "duration_s": 1.0}
    with emulator(arguments(link, faults=[unplug])) as (_, path):
        with Host(path) as host, pytest.raises(OSError, match=r"hung up|Input/output"):
            host.until(lambda: False)
        wait_for(lambda: not link.is_symlink())
        wait_for(link.exists)
        with Host(path) as host:
            host.send(Hello(3))
            host.until(lambda: len(host.of(Ident)) == 1 and len(host.of(Odom)) > 0)
            assert host.of(Odom)[0].t_us >= 3.0e6, "the robot ran on meanwhile"


@in_real_time
@stalls_excused
def test_base_stops_by_itself_when_everything_above_it_is_killed(link: Path, tmp_path: Path) -> None:
    trace = tmp_path / "truth.csv"
    command = arguments(link, trace=trace, exit_with_parent=True)
    middle = f"import subprocess, sys; sys.exit(subprocess.call({command!r}))"
    with subprocess.Popen([sys.executable, "-c", middle], cwd=ROOT, stdout=subprocess.PIPE) as parent:
        assert parent.stdout is not None
        assert parent.stdout.readline().startswith(b"ready")
        with Host(str(link)) as host:
            while not rows(trace) or rows(trace)[-1]["v_m_s"] < 0.25:
                host.send(Drive(0, 300, 0))
                host.pump(0.02)
            started = time.monotonic()
            parent.kill()
            killed = time.monotonic()
        wait_for(lambda: rows(trace)[-1]["host_s"] > killed + 2.9)
        # By the robot's own time, which stands still together with the emulator.
        killed_t = max(row["t_s"] for row in rows(trace) if row["host_s"] <= killed)
        after = [row for row in rows(trace) if row["t_s"] > killed_t + 0.5 + 0.3]
        assert {row["v_m_s"] for row in after} == {0.0}
        assert {int(row["flags"]) for row in after} == {8}
        wait_for(lambda: not link.is_symlink())
        assert started + LINGER_S - LAG_MAX_S <= rows(trace)[-1]["host_s"] <= killed + LINGER_S + 1.0


@in_real_time
@stalls_excused
def test_truth_is_written_while_it_runs(link: Path, tmp_path: Path) -> None:
    trace = tmp_path / "truth.csv"
    with emulator(arguments(link, trace=trace)):
        wait_for(lambda: len(rows(trace)) >= 60)
        written, now = rows(trace), time.monotonic()
        assert trace.read_text().startswith(HEADER + "\n")
        assert max(b["t_s"] - a["t_s"] for a, b in itertools.pairwise(written)) <= 0.0201
        assert now - 5.0 < written[-1]["host_s"] <= now
        shift = [row["host_s"] - row["t_s"] for row in written]
        rounding = 2e-6  # each column is written to the microsecond
        assert all(b >= a - rounding for a, b in itertools.pairwise(shift)), (
            "the robot's clock never gains on the host's"
        )


@in_real_time
def test_unwritable_trace_is_one_clear_line(link: Path, tmp_path: Path) -> None:
    done = subprocess.run(
        arguments(link, trace=tmp_path / "nowhere" / "t.csv"),
        cwd=ROOT,
        text=True,
        capture_output=True,
        timeout=TIMEOUT_S,
        check=False,
    )
    assert done.returncode == 1
    assert "nowhere" in done.stderr
    assert done.stderr.count("\n") == 1
    assert not link.is_symlink()


@in_real_time
@stalls_excused
def test_frozen_emulator_goes_on_without_a_burst(link: Path) -> None:
    with emulator(arguments(link)) as (process, path), Host(path) as host:
        host.until(lambda: len(host.of(Odom)) >= 5)
        process.send_signal(signal.SIGSTOP)
        with contextlib.suppress(AssertionError):
            quiet = time.monotonic() + 1.0
            while time.monotonic() < quiet:
                host.pump()
        seen = len(host.of(Odom))
        began = time.monotonic()
        process.send_signal(signal.SIGCONT)
        host.until(lambda: len(host.of(Odom)) >= seen + 20)
        robot_passed_s = (host.of(Odom)[-1].t_us - host.of(Odom)[seen - 1].t_us) * 1e-6
        assert robot_passed_s <= time.monotonic() - began + LAG_MAX_S + 0.05
        assert host.decoder.bad == 0


def test_the_emulators_clock_slips_rather_than_bursts() -> None:
    timeline = SlippingClock(100.0)
    strides = list(timeline.steps(100.035))
    assert strides == pytest.approx([0.01, 0.02, 0.03, 0.035])
    assert timeline.reading_at(0.035) == pytest.approx(100.035)
    assert list(timeline.steps(100.035)) == []
    assert list(timeline.steps(105.0))[-1] == pytest.approx(0.035 + LAG_MAX_S)
    assert timeline.slipped_s == pytest.approx(105.0 - 100.035 - LAG_MAX_S)
    assert timeline.reading_at(0.035 + LAG_MAX_S) == pytest.approx(105.0)
