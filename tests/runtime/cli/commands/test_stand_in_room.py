"""Tests of `echolocate stand --map`: the robot's pose in a known room from one round of its ring."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from config.errors import DONE, FAILED, WRONG_CALL
from config.load import load_settings, load_world
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.firing_pattern import firing_pattern, pattern_pairs, sensors
from drivers.messages import Firing, Pose
from runtime.cli.app import run_command
from runtime.recording.ring_log_rows import write_ring_log

RING = load_settings("hallway").ring
RING_AT = Pose(0.5, -1.0, 0.7)
TURNED_RAD = 0.2
"""The robot looks so far to the left of its ring's sensor 0."""


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """Return a ring log of two rounds from one stand in the shipped room, by an odometry that began there."""
    world = load_world("room")
    sonar = Sonar(RING, compile_scene(world), world.acoustics, np.random.default_rng(1))
    firings = []
    for k, fired in enumerate((*firing_pattern(RING).masks,) * 2):
        at = list(sensors(fired))
        ranges = np.full(len(RING.mounts), np.nan)
        ranges[at] = sonar.fire(RING_AT, RING_AT.theta, sensors(fired))[at]
        firings.append(Firing(0.03 * k, Pose(0.0, 0.0, 0.1 + TURNED_RAD), 0.1, ranges))
    path = tmp_path / "log.csv"
    write_ring_log(path, firings, pattern_pairs(RING))
    return path


def test_the_pose_in_the_room_is_that_of_the_robot(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = log.with_suffix(".json")
    assert run_command(["stand", str(log), "--map", "room", "--json", str(out)]) == DONE
    text = capsys.readouterr().out
    assert "Where in room this stand may be" in text
    assert "3 firings from 0.09 to 0.15 s" in text, "the last round alone"
    found = json.loads(out.read_bytes())
    assert found["firings"] == 3
    best = found["poses"][0]
    assert (best["x"], best["y"]) == pytest.approx((RING_AT.x, RING_AT.y), abs=0.05)
    assert best["heading"] == pytest.approx(RING_AT.theta + TURNED_RAD, abs=math.radians(2.0))
    assert best["probability"] > 0.9
    assert sum(pose["probability"] for pose in found["poses"]) <= 1.0


def test_calls_that_find_no_place(log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["stand", str(log), "--map", "hallway"]) == FAILED
    assert "no place in hallway explains what was heard from this stand" in capsys.readouterr().err
    nothing = tmp_path / "nothing.toml"
    nothing.write_text("[acoustics]\nmodel = 'cone'\n")
    assert run_command(["stand", str(log), "--map", str(nothing)]) == WRONG_CALL
    assert "holds no wall, box, polygon or drum" in capsys.readouterr().err
