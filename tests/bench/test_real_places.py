"""The place on a drive that is written here: exact odometry stays exact."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bench.real_places import measure
from tests.bench.test_real_rooms import ROBOT, write


@pytest.mark.compiled
def test_exact_odometry_stays_exact(tmp_path: Path) -> None:
    drive = tmp_path / "aisle-cone"
    drive.mkdir()
    (drive / "robot.toml").write_text(ROBOT)
    xs = [0.05 * k for k in range(80)]
    write(
        drive / "ring.csv", "t,x,y,theta,r00,r01", [[0.1 * k, 1.02 * x, 0, 0, 1.0, "inf"] for k, x in enumerate(xs)]
    )
    write(drive / "truth.csv", "x,y,theta", [[x, 0.0, 0.0] for x in xs])
    write(drive / "bearings.csv", "b00,b01", [[0.0, ""] for _ in xs])
    rows = measure([drive], lambda _: None)
    assert rows["aisle-cone"]["odometry"] == pytest.approx(0.02 * float(np.std(xs)))
    assert rows["aisle-cone, exact"]["end"] < 1e-9
    assert rows["aisle-cone, exact"]["wrong"] == 0.0
    assert 0.0 <= rows["aisle-cone, exact"]["explained"] <= 1.0
    assert rows["aisle-cone, exact"]["explained in a run"] == rows["aisle-cone, exact"]["explained"]
    assert rows["aisle-cone, exact"]["not tracking"] < 1.0
