"""What recording costs the control loop, and how fast a ring log is read, each beside a control."""

from __future__ import annotations

import csv
import math
import statistics
import time
from pathlib import Path
from typing import Any

import numpy as np

from drivers.messages import Firing, Pose
from runtime.recording.channels import encode
from runtime.recording.recorder import Recorder
from runtime.recording.ring_log import read_ring_log, write_ring_log
from runtime.recording.schema import Cycle
from runtime.recording.storage import SingleFile
from runtime.simulation.closed_loop import simulate
from tests.recorded import hall

FIRINGS = 5456
SENSORS = 24


def test_handing_a_cycle_over_costs_less_than_encoding_it() -> None:
    settings = hall("recording.keyframe_period_s=3600.0")
    assert settings.world is not None
    handed_s, encoded_s = [], []
    recorder = Recorder(settings, SingleFile(Path("/nowhere/at/all")), clock=lambda: 0.0)

    def on_state(cycle: Any, state: Any, _start: Any) -> None:
        began_s = time.perf_counter()
        recorder.on_cycle(cycle, state)
        handed_s.append(time.perf_counter() - began_s)
        began_s = time.perf_counter()
        encode(Cycle.model_construct(record=cycle))
        encoded_s.append(time.perf_counter() - began_s)

    simulate(settings, settings.world, 0, 5.0, on_state=on_state)
    assert statistics.median(handed_s) < statistics.median(encoded_s)


def test_a_long_ring_log_is_read_fast(tmp_path: Path) -> None:
    """Reading takes about three times as long as parsing the numbers alone; ten times is the limit."""
    rng = np.random.default_rng(24)
    ranges_m = rng.uniform(0.3, 5.0, (FIRINGS, SENSORS)).round(3)
    ranges_m[rng.random(ranges_m.shape) < 0.14] = math.inf
    path = tmp_path / "log.csv"
    write_ring_log(path, (Firing(k / 9, Pose(0.0, 0.0, 0.0), 0.0, row) for k, row in enumerate(ranges_m)))
    read_s, parsed_s = [], []
    for _ in range(3):
        before_s = time.process_time()
        assert sum(1 for _ in read_ring_log(path, sensors=SENSORS)) == FIRINGS
        between_s = time.process_time()
        with path.open(newline="", encoding="utf-8") as file:
            rows = csv.reader(file)
            next(rows)
            assert sum(len([float(cell) for cell in row]) for row in rows) == (SENSORS + 5) * FIRINGS
        read_s.append(between_s - before_s)
        parsed_s.append(time.process_time() - between_s)
    assert min(read_s) < 10.0 * min(parsed_s), (read_s, parsed_s)
