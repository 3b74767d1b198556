"""Short form of `python -m bench.growth`: a drive grows, compiles and collects nothing."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = [pytest.mark.realtime, pytest.mark.usefixtures("warm_kernels")]

ROOT = Path(__file__).parents[2]
CYCLES = 2000


def test_drive_does_not_grow_compile_or_collect() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "bench.growth", str(CYCLES)],
        cwd=ROOT, text=True, capture_output=True, timeout=300, check=False,
    )  # fmt: skip
    assert done.stdout, done.stderr
    figures = json.loads(done.stdout)
    assert figures["signatures"] > 10, "the kernels are not counted, so a late compilation would be missed"
    assert figures["compilations"] == 0, figures
    assert figures["collections"][1] > 0, figures
    assert figures["collections"][2] == 0, figures
    assert figures["modes"] == ["DRIVE"], figures
    assert figures["growth_mb"] < 1.0, figures
    assert done.returncode == 0, figures
