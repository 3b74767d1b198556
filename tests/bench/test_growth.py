"""Short form of `python -m bench.growth`: a drive across the clock's wrap grows, compiles and collects nothing."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

pytestmark = [pytest.mark.realtime, pytest.mark.usefixtures("warm_kernels"), pytest.mark.promise("P15")]

ROOT = Path(__file__).parents[2]
CYCLES = 700
WRAP_S = 25.0


def test_drive_does_not_grow_compile_or_collect(measured: Callable[[str], None]) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "bench.growth", str(CYCLES), "--wrap-s", str(WRAP_S)],
        cwd=ROOT, text=True, capture_output=True, check=False,
    )  # fmt: skip
    assert done.stdout, done.stderr
    assert "never retrieved" not in done.stderr
    figures = json.loads(done.stdout)
    assert figures["signatures"] > 10, "the kernels are not counted, so a late compilation would be missed"
    assert figures["compilations"] == 0, figures
    assert figures["collections"][1] > 0, figures
    assert figures["collections"][2] == 0, figures
    assert figures["modes"] == ["DRIVE"], figures
    assert figures["wraps"] == 1, figures
    assert figures["growth_mb"] < 1.0, figures
    assert done.returncode == 0, figures
    measured(f"{CYCLES} cycles in virtual time, t_us wrapped: {figures['growth_mb']:+.2f} MB, always in DRIVE")
