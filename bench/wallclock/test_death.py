"""How soon the base stands still when the main process is killed or stopped while the robot drives."""

from __future__ import annotations

import signal
from collections.abc import Callable
from pathlib import Path

import pytest

from drivers.messages import Flags
from tests.hil.machine import stalls_excused
from tests.hil.running import DEADMAN_S, emulated, running, wait_for
from tests.hil.truth import is_driving, reaches, robot_time, rows

pytestmark = pytest.mark.usefixtures("warm_kernels")

STOPPED_WITHIN_S = DEADMAN_S + 0.3
"""The deadman, and the ramp down to a stop."""
WATCHED_S = 2.0


@stalls_excused
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_the_base_stops_by_itself(tmp_path: Path, number: signal.Signals, measured: Callable[[str], None]) -> None:
    with (
        emulated(tmp_path, fresh=True) as robot,
        running(tmp_path, "run", "run", "--port", robot.port, "--arm", fresh=True) as run,
    ):
        wait_for(lambda: is_driving(robot.trace), "driving")
        sent = run.signal(number)
        wait_for(lambda: reaches(robot.trace, sent.after_s + WATCHED_S), "the end of the trace")
        begin_s = robot_time(robot.trace, sent.after_s)
        seen = [row for row in rows(robot.trace) if row.host_s >= sent.before_s]
    assert max(row.v for row in seen) > 0.2, "it drove when it happened"
    took_s = [row.t_s for row in seen if not row.still][-1] - begin_s
    assert took_s <= STOPPED_WITHIN_S
    assert seen[-1].flags & Flags.DEADMAN
    measured(f"wheels still {took_s:.3f} s after the signal")
