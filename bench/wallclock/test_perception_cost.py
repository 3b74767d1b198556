"""Thread time of perception in milliseconds: of a ring reading, and of a cycle and a quantum under a budget."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

from bench.budget import AMPLE_MS, QUANTUM_MAX_US, costs_of_drive
from config.load import load_settings
from perception.pipeline import Perception
from runtime.simulation.scenes import halls, readings
from tests.perception.test_perception_cost import take
from tests.perception.thread_time import thread_ms

pytestmark = pytest.mark.usefixtures("warm_kernels")

MEDIAN_MS, P99_MS = 1.0, 5.0
"""Limits of the thread time per ring reading."""
CYCLES = 3000


def test_cost_of_a_ring_reading(measured: Callable[[str], None]) -> None:
    settings = load_settings("hallway")
    perception = Perception(settings.ring, settings.models, settings.perception)
    costs_ms = [
        thread_ms(partial(take, perception, firing))
        for firing in readings(settings.ring, halls("clean")[0], 0, passes=4)
    ]
    median_ms, p99_ms = np.quantile(costs_ms, [0.5, 0.99])
    assert median_ms <= MEDIAN_MS
    assert p99_ms <= P99_MS
    measured(f"{len(costs_ms)} ring readings: median {median_ms:.2f} ms, p99 {p99_ms:.2f} ms")


def test_cost_of_a_cycle_and_a_quantum(measured: Callable[[str], None]) -> None:
    settings = load_settings("hallway", ["behaviors.move_ahead.at_end=turn_back"])
    figures = costs_of_drive(settings, CYCLES, 1e-3 * AMPLE_MS).figures()
    assert "budget" not in figures["causes"], figures
    assert figures["quantum_us"]["p99"] <= QUANTUM_MAX_US, figures
    assert figures["perception_us"]["p99.9"] <= figures["budget_us"] + QUANTUM_MAX_US, figures
    measured(f"{CYCLES} cycles: {figures['perception_us']} µs, quanta: {figures['quantum_us']} µs")
