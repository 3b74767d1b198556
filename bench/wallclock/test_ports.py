"""How soon a run ends on a port where no robot answers, over a real pty."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from config.errors import FAILED, WRONG_CALL
from runtime.cycle.connection import CONNECT_MAX_S
from tests.drivers.stranger import Stranger
from tests.hil.machine import BareStarts, stalls_excused
from tests.hil.running import Running, emulated, running

pytestmark = pytest.mark.usefixtures("warm_kernels")

STARTS_MAX = 12
"""Number of bare starts of Python with numba (the slowest measured) within which it opens its ports; an idle machine
needs four."""
Measured = Callable[[str], None]


@contextlib.contextmanager
def run_on(folder: Path, port: str, measured: Measured, timeout_s: float = 0.0) -> Iterator[Running]:
    """Run on a port, and check that the run ends within `timeout_s` after its start."""
    with BareStarts() as bare:
        begin_host_s = time.monotonic()
        with running(folder, "run", "run", "--port", port, "--arm", "--seconds", "600", fresh=True) as run:
            yield run
            took_s = time.monotonic() - begin_host_s
    # A second for what is neither: taking Python down again, and looking whether it has ended.
    assert took_s < timeout_s + 1.0 + STARTS_MAX * bare.longest_s
    measured(f"refused after {took_s:.1f} s (a bare start: {bare.longest_s:.1f} s)")


def check(run: Running, code: int, *pieces: str) -> None:
    assert run.end() == code
    assert run.out == ""
    (line,) = run.error_lines
    for piece in pieces:
        assert piece in line, line


@stalls_excused
def test_a_port_that_answers_garbage(tmp_path: Path, measured: Measured) -> None:
    with Stranger(bytes_per_s=5000) as stranger, run_on(tmp_path, stranger.path, measured, CONNECT_MAX_S) as run:
        check(run, FAILED, "baud")
        assert stranger.heard, "it was asked"


@stalls_excused
def test_a_port_that_is_silent(tmp_path: Path, measured: Measured) -> None:
    with Stranger() as stranger, run_on(tmp_path, stranger.path, measured, CONNECT_MAX_S) as run:
        check(run, FAILED, "HELLO", "nothing is received")
        assert stranger.heard, "it was asked"


@stalls_excused
def test_a_robot_that_is_deaf(tmp_path: Path, measured: Measured) -> None:
    """It sends frames and does not answer."""
    (tmp_path / "faults.toml").write_text("[[fault]]\nat_s = 0.0\nduration_s = 600.0\nkind = 'deaf'\n")
    with (
        emulated(tmp_path, "--faults", str(tmp_path / "faults.toml"), fresh=True) as robot,
        run_on(tmp_path, robot.port, measured, CONNECT_MAX_S) as run,
    ):
        check(run, FAILED, "HELLO", "although the robot sends other frames")


@stalls_excused
def test_a_port_that_goes_away_before_the_handshake(tmp_path: Path, measured: Measured) -> None:
    with Stranger(hangs_up=True) as stranger, run_on(tmp_path, stranger.path, measured) as run:
        check(run, FAILED, stranger.path)


@stalls_excused
def test_a_port_that_does_not_exist(tmp_path: Path, measured: Measured) -> None:
    with run_on(tmp_path, str(tmp_path / "port"), measured) as run:
        check(run, WRONG_CALL, str(tmp_path / "port"))
