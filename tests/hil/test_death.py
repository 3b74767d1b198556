"""The main process dies or stands still while the robot drives: the base stops by itself, and stays stopped."""

from __future__ import annotations

import json
import logging
import signal
import time
from pathlib import Path

import pytest

from drivers.messages import Flags
from tests.hil.machine import stalls_excused
from tests.hil.running import DEADMAN_S, Signalled, emulated, running, wait_for
from tests.hil.truth import Row, is_driving, reaches, robot_time, rows

pytestmark = [pytest.mark.realtime, pytest.mark.usefixtures("warm_kernels")]

STOPPED_WITHIN_S = DEADMAN_S + 0.3
"""The deadman, and the ramp down to a stop."""


def check_stop(trace: Path, sent: Signalled, until_s: float) -> None:
    """Assert that the wheels stand still from `STOPPED_WITHIN_S` after a signal on, by the robot's own clock."""
    wait_for(lambda: reaches(trace, until_s), "the end of the trace")
    begin_s = robot_time(trace, sent.after_s)
    seen = [row for row in rows(trace) if sent.before_s <= row.host_s <= until_s]
    assert max(row.v for row in seen) > 0.2, "it drove when it happened"
    moving: list[Row] = [row for row in seen if not row.still]
    late = [row for row in moving if row.t_s > begin_s + STOPPED_WITHIN_S]
    assert not late, f"still moving {late[-1].t_s - begin_s:.3f} s later"
    logging.getLogger(__name__).info("still %.3f s later", moving[-1].t_s - begin_s)


@stalls_excused
def test_killed_while_driving_on_a_port(tmp_path: Path) -> None:
    with emulated(tmp_path) as robot, running(tmp_path, "run", "run", "--port", robot.port, "--arm") as run:
        wait_for(lambda: is_driving(robot.trace), "driving")
        killed = run.signal(signal.SIGKILL)
        run.process.wait()
        check_stop(robot.trace, killed, killed.after_s + 2.0)
        assert rows(robot.trace)[-1].flags & Flags.DEADMAN


@stalls_excused
def test_killed_while_driving_on_its_own_emulator(tmp_path: Path) -> None:
    """The emulator sees its robot to a stop and then ends by itself."""
    trace = tmp_path / "trace.csv"
    with running(tmp_path, "run", "run", "--trace", str(trace)) as run:
        wait_for(lambda: is_driving(trace), "driving")
        killed = run.signal(signal.SIGKILL)
        run.process.wait()
        check_stop(trace, killed, killed.after_s + 2.0)
        wait_for(lambda: rows(trace)[-1].host_s < time.monotonic() - 1.0, "the emulator's own end")


@stalls_excused
@pytest.mark.parametrize("stopped_s", [1.0, 3.5], ids=["one second", "longer than the pty's buffer lasts"])
def test_stopped_while_driving_and_continued(tmp_path: Path, stopped_s: float) -> None:
    path = tmp_path / "summary.json"
    command = ["run", "--arm", "--json", str(path)]
    with emulated(tmp_path) as robot, running(tmp_path, "run", *command, "--port", robot.port) as run:
        wait_for(lambda: is_driving(robot.trace), "driving")
        stopped = run.signal(signal.SIGSTOP)
        check_stop(robot.trace, stopped, stopped.after_s + max(stopped_s, STOPPED_WITHIN_S + 0.1))
        assert rows(robot.trace)[-1].flags & Flags.DEADMAN
        continued = run.signal(signal.SIGCONT)
        run.comes_to("SAFE_STOP")
        check_stop(robot.trace, stopped, continued.after_s + 1.5)
        assert run.modes() == ["READY", "DRIVE", "SAFE_STOP"]
        assert rows(robot.trace)[-1].flags & Flags.LATCHED

        run.signal(signal.SIGUSR1)
        wait_for(lambda: is_driving(robot.trace), "driving after it was armed")
        run.signal(signal.SIGTERM)
        assert run.end() == 0
    summary = json.loads(path.read_bytes())
    assert len(summary["stop_reasons"]) == 1
    assert run.error_lines == []
