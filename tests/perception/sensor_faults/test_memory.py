"""What is remembered of each sensor: all zero at first, and the same after a snapshot."""

from __future__ import annotations

import numpy as np

from drivers.messages import Firing, Pose
from perception.records import zeros
from perception.sensor_faults.memory import LOOKS_KEPT, SETS_MAX, NeighbourCounts, RingMemory, SensorMemory
from perception.sensor_faults.monitor import SensorMonitor
from perception.snapshot import put_back, snapshot_of
from tests.perception.halls import settings


def test_a_new_memory_is_zero_and_has_room_for_every_set() -> None:
    memory = zeros(SensorMemory, 24)
    assert memory.tobytes() == bytes(memory.nbytes)
    assert memory["short_readings"].shape == memory["is_crossed"].shape == (24, SETS_MAX)
    assert memory["run_neighbours"].shape == (24, 2)
    assert memory["run_neighbours"].dtype == NeighbourCounts.DTYPE
    assert memory["looks"].shape == (24, LOOKS_KEPT)
    assert zeros(RingMemory, 1)["sets_seen"].tolist() == [0]


def test_it_is_part_of_a_snapshot() -> None:
    ring = settings().ring
    monitor, other = SensorMonitor(ring), SensorMonitor(ring)
    for k in range(10):
        monitor.filter(Firing(0.05 * k, Pose(0.01 * k, 0.0, 0.0), 0.0, np.full(24, 2.0)))
    snapshot = snapshot_of(monitor)
    assert snapshot["_sensors"]["readings"].tolist() == [10] * 24
    assert snapshot["_ring"]["firings"].tolist() == [10]
    put_back(other, snapshot)
    assert all(snapshot[name].tobytes() == value.tobytes() for name, value in snapshot_of(other).items())
