"""Processor time of reading a ring log and of driving in virtual time, beside a control or the robot's own time."""

from __future__ import annotations

import csv
import math
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from runtime.recording.ring_log import read_ring_log
from runtime.recording.ring_log_rows import write_ring_log
from tests.runtime.cli.commands.experiments.test_experiment import experiment
from tests.runtime.recording.test_ring_log import firing

pytestmark = pytest.mark.usefixtures("warm_kernels")

ROWS = 5456


def test_a_long_recording_is_read_fast(tmp_path: Path, measured: Callable[[str], None]) -> None:
    rng = np.random.default_rng(24)
    ranges = rng.uniform(0.3, 5.0, (ROWS, 24)).round(3)
    ranges[rng.random(ranges.shape) < 0.14] = math.inf
    path = tmp_path / "log.csv"
    write_ring_log(path, (firing(i / 9, row) for i, row in enumerate(ranges.tolist())))
    spent, bare = [], []
    for _ in range(3):
        before = time.process_time()
        count = sum(1 for _ in read_ring_log(path, sensors=24))
        between = time.process_time()
        with path.open(newline="", encoding="utf-8") as file:
            rows = csv.reader(file)
            next(rows)
            assert sum(len([float(cell) for cell in row]) for row in rows) == 29 * ROWS
        spent.append(between - before)
        bare.append(time.process_time() - between)
    assert count == ROWS
    # Three times as long as reading the numbers alone, which checks nothing and keeps nothing.
    assert min(spent) < 10.0 * min(bare), (spent, bare)
    measured(f"{ROWS} rows in {min(spent):.2f} s of processor time; the numbers alone in {min(bare):.2f} s")


def test_twenty_times_as_fast_as_the_robot(tmp_path: Path, measured: Callable[[str], None]) -> None:
    begin_s, begin_cpu_s = time.monotonic(), time.process_time()
    outcome = experiment(tmp_path, "hallway")
    elapsed_s, cpu_s = time.monotonic() - begin_s, time.process_time() - begin_cpu_s
    # By the processor's clock: what others do on this machine meanwhile costs nothing here.
    times = outcome["times_real_time"] * elapsed_s / cpu_s
    assert times >= 20.0, (elapsed_s, cpu_s)
    measured(f"the hallway in virtual time: {times:.0f} times as fast as the robot, by processor time")
