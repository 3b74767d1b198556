"""A drive leaves nothing behind: the short form of `make soak`."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = [pytest.mark.realtime, pytest.mark.usefixtures("warm_kernels")]

ROOT = Path(__file__).parents[2]
CYCLES = 2000


def test_a_drive_grows_by_nothing_and_compiles_and_collects_nothing() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "bench.growth", str(CYCLES)],
        cwd=ROOT, text=True, capture_output=True, timeout=300, check=False,
    )  # fmt: skip
    assert done.stdout, done.stderr
    figures = json.loads(done.stdout)
    assert figures["signatures"] > 10, "the count sees no kernels: it would miss a late one"
    assert figures["compilations"] == 0, figures
    assert figures["collections"][1] > 0, figures
    assert figures["collections"][2] == 0, figures
    assert figures["modes"] == ["DRIVE"], figures
    assert figures["growth_mb"] < 1.0, figures
    assert done.returncode == 0, figures
