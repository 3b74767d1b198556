"""The truth trace: a header, and at most one row for each hundredth of a second."""

from __future__ import annotations

import io
import itertools

from drivers.emulator.robot_device import GroundTruth
from drivers.emulator.truth_trace import HEADER, TruthTrace
from drivers.messages import Flags, Pose, Twist


def truth(emulated_s: float) -> GroundTruth:
    flags = Flags.LATCHED | Flags.BUMPER
    return GroundTruth(emulated_s, Pose(1.5, -2.0, 0.25), 0.5, Twist(0.3, -0.1), flags, contacts=1)


def test_a_row_holds_the_true_state() -> None:
    file = io.StringIO()
    TruthTrace(file).write(truth(0.5), host_s=1234.0)
    header, row = file.getvalue().splitlines()
    assert header == HEADER
    fields = dict(zip(header.split(","), map(float, row.split(",")), strict=True))
    assert fields == {
        "t_s": 0.5, "host_s": 1234.0, "x_m": 1.5, "y_m": -2.0, "heading_rad": 0.25, "ring_yaw_rad": 0.5,
        "v_m_s": 0.3, "w_rad_s": -0.1, "flags": 3.0,
    }  # fmt: skip


def test_rows_are_at_least_a_period_apart() -> None:
    file = io.StringIO()
    trace = TruthTrace(file)
    for k in range(101):
        trace.write(truth(0.001 * k), host_s=0.0)
    times = [float(row.split(",")[0]) for row in file.getvalue().splitlines()[1:]]
    assert len(times) in {10, 11}
    assert all(b - a >= 0.00999 for a, b in itertools.pairwise(times))
