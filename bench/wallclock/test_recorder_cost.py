"""What recording costs the control loop, beside the cost of encoding."""

from __future__ import annotations

import statistics
import time
from pathlib import Path
from typing import Any

from runtime.recording.channels import encode
from runtime.recording.recorder import Recorder
from runtime.recording.schema import Cycle
from runtime.recording.storage import SingleFile
from runtime.simulation.closed_loop import simulate
from tests.recorded import hall


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
