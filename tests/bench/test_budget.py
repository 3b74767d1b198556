"""Short form of `python -m bench.budget`: no cycle exceeds its refinement budget by more than one quantum."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CYCLES = 3000


@pytest.mark.realtime
@pytest.mark.usefixtures("warm_kernels")
def test_no_cycle_exceeds_its_budget_by_more_than_a_quantum() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "bench.budget", str(CYCLES)],
        cwd=ROOT, text=True, capture_output=True, timeout=300, check=False,
    )  # fmt: skip
    found = [json.loads(line) for line in done.stdout.splitlines()]
    assert [row["in_every_drive"]["cycles_beyond_a_quantum"] for row in found] == [0, 0], done.stdout
    ample, tight = (row["drives"][0] for row in found)
    assert ample["cycles"] == tight["cycles"] == CYCLES
    assert "budget" not in ample["causes"], ample
    assert tight["causes"]["budget"] > 50, tight
    for figures in (ample, tight):
        # A thread's CPU time includes disturbances by the machine; the strictest limits are those of `make soak`.
        assert figures["quantum_us"]["p99"] <= 500.0, figures
        assert figures["perception_us"]["p99.9"] <= figures["budget_us"] + 500.0, figures
