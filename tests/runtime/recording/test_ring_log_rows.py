"""Rows of a ring log; test_ring_log.py and test_servo_columns.py write those of all kinds, and read them again."""

from __future__ import annotations

import io
import math
from pathlib import Path

import numpy as np
import pytest

from drivers.messages import Firing, Pose
from runtime.recording.ring_log import RingLogError
from runtime.recording.ring_log_rows import RingLogRows


def test_the_header_comes_with_the_first_row_and_a_log_without_rows_is_refused() -> None:
    file = io.StringIO()
    rows = RingLogRows(file, Path("log.csv"))
    with pytest.raises(RingLogError, match="no firing to write"):
        rows.check_not_empty()
    rows.write(Firing(1.5, Pose(0.0, 1.0, 2.0), 3.0, np.array([math.nan, math.inf, 0.5])))
    assert file.getvalue() == "t,x,y,theta,ring_yaw,r00,r01,r02\n1.5,0.0,1.0,2.0,3.0,,inf,0.5\n"
    rows.check_not_empty()
