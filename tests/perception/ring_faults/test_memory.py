"""What is remembered of the ring's readings on its way: part of a snapshot."""

from __future__ import annotations

import math

import numpy as np

from config.load import load_settings
from drivers.messages import Firing, Pose
from perception.records import zeros
from perception.ring_faults.memory import EchoTrace, RingTrace
from perception.ring_faults.monitor import RingMonitor
from perception.snapshot import put_back, snapshot_of


def test_a_new_memory_is_zero() -> None:
    for memory in (zeros(EchoTrace, 24), zeros(RingTrace, 1)):
        assert memory.tobytes() == bytes(memory.nbytes)


def test_it_is_part_of_a_snapshot_and_finite() -> None:
    ring = load_settings("hallway").ring
    monitor, other = RingMonitor(ring), RingMonitor(ring)
    for k in range(20):
        ranges = np.where(np.arange(24) % 2, math.inf, 3.0 - 0.015 * k)
        monitor.observe(Firing(0.05 * k, Pose(0.015 * k, 0.0, 0.0), 0.0, ranges))
    snapshot = snapshot_of(monitor)
    assert all(np.isfinite(values).all() for name, values in snapshot.items() if not values.dtype.names)
    put_back(other, snapshot)
    again = snapshot_of(other)
    assert again.keys() == snapshot.keys()
    assert all(again[name].tobytes() == values.tobytes() for name, values in snapshot.items())
