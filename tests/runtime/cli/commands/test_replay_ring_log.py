"""Tests of `echolocate replay` of a ring log: objects, counts and the summary."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from config.errors import DONE
from runtime.analysis.timeline_sources import TimelineSource, load_timeline
from runtime.cli.app import run_command


@pytest.mark.usefixtures("bad_files")
def test_a_replay_of_one_firing(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["replay", "good.csv", "--model", "drum", "--model", "box", "--json", "x.json"]) == DONE
    captured = capsys.readouterr()
    assert captured.err == ""
    assert "1 firings, 0 outline segments, 0 clusters" in captured.out
    assert Path("x.json").stat().st_size > 0


def test_a_ring_log_gives_the_objects_of_its_recording(hall_run: Path, hall_log: Path, tmp_path: Path) -> None:
    summary = tmp_path / "summary.json"
    assert run_command(["replay", str(hall_log), "--json", str(summary)]) == DONE
    seen = json.loads(summary.read_bytes())["objects"]
    objects = load_timeline(TimelineSource(str(hall_run)), lambda _settings: None).objects
    assert len(seen) >= 3
    for one in seen:
        assert min(math.hypot(one["x"] - o.x, one["y"] - o.y) for o in objects) < 0.02
