"""What becomes of the figures with one number changed: what differs is shown, and so is a run that fails."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from subprocess import CompletedProcess

import orjson
import pytest

from bench.sensitivity import NEAR_M, log_figures, outcomes, real_figures
from bench.varied_source import TunedNumber

pytestmark = pytest.mark.compiled
ROBOT = """
[ring]
sensors = [{x_m = 0.0, y_m = 0.0, angle_deg = 0.0}, {x_m = 0.0, y_m = 0.0, angle_deg = 90.0}]
beam_half_angle_deg = 12.0
resolution_m = 0.01
range_min_m = 0.1
range_max_m = 5.0
[body]
radius_m = 0.25
speed_max_m_s = 0.5
turn_max_rad_s = 1.0
synchro = false
"""


def test_a_figure_that_changes_and_a_run_that_fails_are_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    def answer(program: Sequence[str], **_: object) -> CompletedProcess[bytes]:
        value = next((float(one.partition("=")[2]) for one in program if one.startswith("--value")), 10.0)
        if value < 8.0:
            return CompletedProcess(program, 1, b"", b"Traceback\nValueError: too small")
        return CompletedProcess(program, 0, orjson.dumps({"a": value, "b": 1.0}), b"")

    monkeypatch.setattr("bench.sensitivity.subprocess.run", answer)
    number = TunedNumber("m", "N", 10.0)
    smaller, greater = outcomes([number], (), (), 1)
    assert (smaller.value, smaller.changed, smaller.failed) == (7.0, {}, "ValueError: too small")
    assert (greater.value, greater.changed, greater.failed) == (14.0, {"a": (10.0, 14.0)}, None)


@pytest.mark.usefixtures("warm_kernels")
def test_a_drive_along_a_wall_is_explained(tmp_path: Path) -> None:
    (tmp_path / "robot.toml").write_text(ROBOT)
    rows = [(0.1 * k, 0.05 * k, 0.0, 0.0) for k in range(80)]
    (tmp_path / "ring.csv").write_text(
        "t,x,y,theta,r00,r01\n" + "".join(f"{t:.2f},{x:.3f},{y},{theta},inf,1.0\n" for t, x, y, theta in rows)
    )
    (tmp_path / "truth.csv").write_text("x,y,theta\n" + "".join(f"{x:.3f},{y},{theta}\n" for _, x, y, theta in rows))
    (tmp_path / "bearings.csv").write_text("b00,b01\n" + ",1.5708\n" * len(rows))
    (explained,) = real_figures(tmp_path).values()
    assert explained > 0.95
    log = log_figures(tmp_path / "ring.csv", tmp_path / "robot.toml")
    assert log["ring: walls, m"] == pytest.approx(rows[-1][1], abs=2.0 * NEAR_M)
    assert log["ring: other objects"] == 0
