"""P15: long runs: memory, tasks, and the robot's clock, which wraps every 71.6 minutes.

Short forms are in tests/bench/test_growth.py and, for the wrap on a pty, in tests/hil/test_signals.py.
"""

from __future__ import annotations

import json
import logging
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.hil.running import ROOT, emulated, running
from tests.hil.truth import Truth

pytestmark = [pytest.mark.realtime, pytest.mark.usefixtures("warm_kernels"), pytest.mark.promise("P15")]

RATE_HZ = 20
WRAP_S = 2**32 * 1e-6


def drive_for(hours: float, wrap_s: float, timeout_s: float) -> dict[str, Any]:
    """Drive for `hours` in virtual time, in a process of its own, and return the figures of `bench.growth`."""
    cycles = round(hours * 3600 * RATE_HZ)
    done = subprocess.run(
        [sys.executable, "-X", "dev", "-m", "bench.growth", str(cycles), "--wrap-s", str(wrap_s)],
        cwd=ROOT, text=True, capture_output=True, timeout=timeout_s, check=False,
    )  # fmt: skip
    assert done.stdout, done.stderr
    figures: dict[str, Any] = json.loads(done.stdout)
    assert "never retrieved" not in done.stderr
    assert figures["modes"] == ["DRIVE"], figures
    assert figures["slope_mb_h"] < 1.0, figures
    assert done.returncode == 0, figures
    return figures


@pytest.mark.soak
def test_a_day_in_virtual_time(measured: Callable[[str], None]) -> None:
    figures = drive_for(24.0, 900.0, 6 * 3600.0)
    assert figures["wraps"] == 20
    measured(f"24 h in virtual time, t_us wrapped 20 times: {figures['slope_mb_h']:+.3f} MB/h, always in DRIVE")


def on_the_pty(folder: Path, seconds: float, wrap_s: float) -> dict[str, Any]:
    """Drive for `seconds` on a pseudo-terminal, and return the summary of the run."""
    path = folder / "summary.json"
    command = ["run", "hallway", "--arm", "--seconds", str(seconds), "--json", str(path), "--no-record"]
    with (
        emulated(folder, "--clock", str(WRAP_S - wrap_s), fresh=True) as robot,
        running(folder, "run", *command, "--port", robot.port, fresh=True) as run,
    ):
        assert run.process.wait(seconds + 60.0) == 0, run.err
        assert run.error_lines == []
        assert "Traceback" not in run.err
        assert Truth(robot.trace).read()[-1].t_s > wrap_s
        assert max(row.v for row in Truth(robot.trace).read()) > 0.1
    summary: dict[str, Any] = json.loads(path.read_bytes())
    log = (folder / "run.jsonl").read_text("utf-8")
    assert "never retrieved" not in run.err + log
    assert '"level":"error"' not in log
    logging.getLogger(__name__).info("%s", summary["process"])
    return summary


def check_stops(summary: dict[str, Any]) -> None:
    """Assert that the robot was stopped by nothing but a busy machine."""
    others = [reason for reason in summary["stop_reasons"] if "held up for" not in reason]
    assert not others, summary["stop_reasons"]


@pytest.mark.soak
def test_an_hour_on_the_pty(tmp_path: Path, measured: Callable[[str], None]) -> None:
    summary = on_the_pty(tmp_path, 3600.0, 1800.0)
    check_stops(summary)
    growth_mb = summary["process"]["growth_mb"]
    assert growth_mb < 1.0, summary["process"]
    measured(f"1 h on the pty, t_us wrapped: {growth_mb:+.2f} MB")
