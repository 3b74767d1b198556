"""Tests of the footprint of a run, compared with known work."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path

import pytest

from runtime.timing.footprint import Footprint, age_s, own_mb, peak_mb, rss_mb
from runtime.timing.memory_policy import MemoryPolicy

ROOT = Path(__file__).parents[3]


FILLED = """
import json
import numpy as np
from runtime.timing.footprint import Footprint
from runtime.timing.memory_policy import MemoryPolicy
stats = Footprint(MemoryPolicy())
block = np.full(8_000_000, 1.0)
print(json.dumps(stats.close()), block[0])
"""


def test_allocated_memory_is_measured() -> None:
    """In a process of its own, because memory of earlier tests may be freed at any time."""
    done = subprocess.run([sys.executable, "-c", FILLED], cwd=ROOT, text=True, capture_output=True, check=True)
    row = json.loads(done.stdout.rpartition(" ")[0])
    assert 50.0 < row["growth_mb"] < 100.0
    assert row["rss_mb"] > row["growth_mb"]
    assert row["rss_peak_mb"] >= row["growth_mb"]


def test_cpu_time_is_a_share_of_elapsed_time() -> None:
    """How large the share of a busy loop is depends on what else runs on this machine."""
    stats = Footprint(MemoryPolicy())
    end_cpu_s = time.process_time() + 0.05
    while time.process_time() < end_cpu_s:
        pass
    row = stats.close()
    assert row["cpu_share"] > 0.0
    assert row["compilations"] == 0
    assert row["collections"] == [0, 0, 0]


def test_the_age_of_the_process_grows_with_the_clock() -> None:
    before, begin_s = age_s(), time.monotonic()
    assert before is not None
    while time.monotonic() < begin_s + 0.02:
        pass
    after = age_s()
    assert after is not None
    assert after - before >= 0.02 - 1e-3
    assert before > 0.0


def test_a_system_without_proc_is_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_arguments: object, **_named: object) -> str:
        raise FileNotFoundError(2, "no such file")

    monkeypatch.setattr("runtime.timing.footprint.Path.read_text", refuse)
    assert (age_s(), rss_mb(), own_mb(), peak_mb()) == (None, None, None, None)
    row = Footprint(MemoryPolicy()).close()
    assert (row["start_s"], row["rss_mb"], row["growth_mb"]) == (None, None, None)
