"""Ports on which no robot answers: one clear line, the right exit code, soon, and never a traceback."""

from __future__ import annotations

import contextlib
import fcntl
import os
import random
import select
import termios
import threading
import time
import tty
from collections.abc import Iterator
from pathlib import Path

import pytest

from config.errors import FAILED, WRONG_CALL
from runtime.cycle.connection import CONNECT_MAX_S
from tests.hil.machine import BareStarts, stalls_excused
from tests.hil.running import Running, emulated, running, wait_for
from tests.hil.truth import is_driving

pytestmark = [pytest.mark.realtime, pytest.mark.usefixtures("warm_kernels")]

STARTS_MAX = 12
"""Number of bare starts of Python with numba (the slowest measured) within which it opens its ports; an idle machine
needs four."""


class Stranger:
    """Something on the other end of a pty that is no robot."""

    def __init__(self, *, bytes_per_s: int = 0, seed: int = 1) -> None:
        self.master, slave = os.openpty()
        tty.setraw(slave)
        self.path = os.ttyname(slave)
        self._slave: int | None = slave
        os.set_blocking(self.master, False)
        self.heard = bytearray()
        self._rate, self._random = bytes_per_s, random.Random(seed)
        self._done = threading.Event()
        self._worker = threading.Thread(target=self._work)

    def hang_up(self) -> None:
        """Be gone, as an adapter pulled out."""
        self._done.set()
        self._worker.join()
        os.close(self.master)
        self.master = -1

    def _work(self) -> None:
        while not self._done.is_set():
            with contextlib.suppress(OSError):
                if select.select([self.master], [], [], 0.02)[0]:
                    self.heard += os.read(self.master, 4096)
                if self._rate:
                    os.write(self.master, self._random.randbytes(max(1, self._rate // 50)))

    def __enter__(self) -> Stranger:
        self._worker.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self.master >= 0:
            self.hang_up()
        if self._slave is not None:
            os.close(self._slave)


@contextlib.contextmanager
def run_on(folder: Path, port: str, timeout_s: float = 0.0) -> Iterator[Running]:
    """Run on a port, and check that the run ends within `timeout_s` after its start."""
    with BareStarts() as bare:
        begin_host_s = time.monotonic()
        with running(folder, "run", "run", "--port", port, "--arm", "--seconds", "600") as run:
            yield run
            took_s = time.monotonic() - begin_host_s
    # A second for what is neither: taking Python down again, and looking whether it has ended.
    assert took_s < timeout_s + 1.0 + STARTS_MAX * bare.longest_s


def check(run: Running, code: int, *pieces: str) -> None:
    assert run.end() == code
    assert run.out == ""
    (line,) = run.error_lines
    for piece in pieces:
        assert piece in line, line


@stalls_excused
def test_a_port_that_answers_garbage(tmp_path: Path) -> None:
    with Stranger(bytes_per_s=5000) as stranger, run_on(tmp_path, stranger.path, CONNECT_MAX_S) as run:
        check(run, FAILED, "baud")
        assert len(stranger.heard) > 0, "it was asked"


@stalls_excused
def test_a_port_that_says_nothing(tmp_path: Path) -> None:
    with Stranger() as stranger, run_on(tmp_path, stranger.path, CONNECT_MAX_S) as run:
        check(run, FAILED, "HELLO", "nothing is received")
        assert len(stranger.heard) > 0, "it was asked"


@pytest.mark.promise("P13")
@stalls_excused
def test_a_port_in_use(tmp_path: Path) -> None:
    """Both ways to say so: the lock that this program takes, too, and a terminal opened for one alone."""
    with Stranger() as stranger:
        fd = os.open(stranger.path, os.O_RDWR | os.O_NOCTTY)
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        try:
            with run_on(tmp_path, stranger.path) as run:
                check(run, FAILED, stranger.path, "in use")
        finally:
            os.close(fd)


@pytest.mark.promise("P13")
@stalls_excused
def test_a_robot_that_another_run_drives(tmp_path: Path) -> None:
    with emulated(tmp_path) as robot:
        (tmp_path / "other").mkdir()
        with running(tmp_path / "other", "run", "run", "--port", robot.port, "--arm") as first:
            wait_for(lambda: is_driving(robot.trace), "driving")
            with run_on(tmp_path, robot.port) as second:
                check(second, FAILED, robot.port, "in use")
            assert first.process.poll() is None
            assert first.modes() == ["READY", "DRIVE"], "the first one's drive is not disturbed"
            assert is_driving(robot.trace)


@pytest.mark.promise("P13")
def test_a_robot_whose_first_run_was_killed(tmp_path: Path) -> None:
    """A lock that outlived its owner would keep the robot from everybody; here it ends with the process."""
    with emulated(tmp_path) as robot:
        for name in ("first", "second"):
            (tmp_path / name).mkdir()
            with running(tmp_path / name, "run", "run", "--port", robot.port, "--arm") as run:
                wait_for(lambda: is_driving(robot.trace), f"the {name} drives")
                run.process.kill()
                run.process.wait()
            wait_for(lambda: not is_driving(robot.trace), "the deadman")


@pytest.mark.promise("P13")
def test_a_record_that_another_run_writes(tmp_path: Path) -> None:
    record = str(tmp_path / "run.csv")
    with emulated(tmp_path) as robot:
        (tmp_path / "other").mkdir()
        with running(tmp_path / "other", "run", "run", "--port", robot.port, "--arm", "--record", record) as first:
            wait_for(lambda: is_driving(robot.trace), "driving")
            with (
                Stranger() as stranger,
                running(tmp_path, "run", "run", "--port", stranger.path, "--record", record) as second,
            ):
                check(second, FAILED, f"--record {record}", "another process writes to this file")
                assert not stranger.heard, "it is refused before anything is said to a robot"
            assert first.process.poll() is None


@stalls_excused
def test_a_port_that_goes_away_before_the_handshake(tmp_path: Path) -> None:
    with Stranger() as stranger, run_on(tmp_path, stranger.path) as run:
        wait_for(lambda: len(stranger.heard) > 0, "HELLO")
        if stranger._slave is not None:
            os.close(stranger._slave)
            stranger._slave = None
        stranger.hang_up()
        check(run, FAILED, stranger.path)


@stalls_excused
def test_a_robot_that_is_deaf(tmp_path: Path) -> None:
    """It can be heard and does not answer."""
    (tmp_path / "faults.toml").write_text("[[fault]]\nat_s = 0.0\nduration_s = 600.0\nkind = 'deaf'\n")
    with (
        emulated(tmp_path, "--faults", str(tmp_path / "faults.toml")) as robot,
        run_on(tmp_path, robot.port, CONNECT_MAX_S) as run,
    ):
        check(run, FAILED, "HELLO", "although the robot sends other frames")


@stalls_excused
@pytest.mark.parametrize("kind", ["missing", "file", "folder", "fifo", "null", "dangling link"])
def test_what_is_no_serial_port(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "port"
    match kind:
        case "file":
            path.touch()
        case "folder":
            path.mkdir()
        case "fifo":
            os.mkfifo(path)
        case "null":
            path.symlink_to(os.devnull)
        case "dangling link":
            path.symlink_to(tmp_path / "nowhere")
    with run_on(tmp_path, str(path)) as run:
        check(run, WRONG_CALL, str(path))


def test_terminals_are_left_usable() -> None:
    """That the helper above makes what a serial line looks like."""
    with Stranger() as stranger:
        fd = os.open(stranger.path, os.O_RDWR | os.O_NOCTTY)
        assert not termios.tcgetattr(fd)[3] & termios.ECHO
        os.close(fd)
