"""Tests of `echolocate stand`: the surfaces around a robot that stood, as a table and as JSON."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from config.errors import DONE, FAILED
from drivers.firing_pattern import pattern_pairs
from drivers.messages import Firing, Pose
from runtime.cli.app import run_command
from runtime.recording.ring_log_rows import write_ring_log
from tests.perception.test_stand import BEARING, RANGE_M, RING, heard, scene


def test_the_surfaces_of_a_ring_log(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, out = tmp_path / "log.csv", tmp_path / "found.json"
    write_ring_log(log, heard(scene("wall")), pattern_pairs(RING))
    assert run_command(["stand", str(log), "--robot", "ears", "--json", str(out)]) == DONE
    text = capsys.readouterr().out
    assert "plane" in text
    assert "24 firings from 0.00 to 0.69 s" in text
    found = json.loads(out.read_bytes())
    assert found["firings"] == 24
    (wall,) = found["surfaces"]
    assert wall["kind"] == "plane"
    assert wall["probabilities"]["plane"] > 0.95
    assert (wall["x"], wall["y"]) == pytest.approx(
        (RANGE_M * math.cos(BEARING), RANGE_M * math.sin(BEARING)), abs=0.02
    )


def test_calls_that_show_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = tmp_path / "log.csv"
    write_ring_log(log, [Firing(0.5, Pose(0.0, 0.0, 0.0), 0.0, np.where(np.arange(24) == 3, 1.0, np.nan))])
    assert run_command(["stand", str(log), "--at", "0.1"]) == FAILED
    assert (
        "nothing was fired up to --at 0.1 by the robot's clock; the first firing is at 0.50 s"
        in capsys.readouterr().err
    )
    assert run_command(["stand", str(log), "--at", "60"]) == FAILED
    assert "ends before --at 60.00 by the robot's clock; the last firing is at 0.50 s" in capsys.readouterr().err
    unix = Firing(1764354004.756, Pose(0.0, 0.0, 0.0), 0.0, np.where(np.arange(24) == 3, 1.0, np.nan))
    write_ring_log(log, [unix])
    assert run_command(["stand", str(log), "--at", "1764354010"]) == FAILED
    said = capsys.readouterr().err
    assert "ends before --at 1764354010.00 by the robot's clock; the last firing is at 1764354004.76 s" in said
    assert run_command(["stand", str(log), "--at", "1764354004.76"]) == FAILED
    assert "no surface was heard over three different paths" in capsys.readouterr().err
