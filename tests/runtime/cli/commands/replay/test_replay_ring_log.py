"""Tests of `echolocate replay` of a ring log: objects, counts and the summary."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from config.errors import DONE, WRONG_CALL
from runtime.analysis.timeline_sources import TimelineSource, load_timeline
from runtime.cli.app import run_command
from tests.polylines import BEND, report_bend


@pytest.mark.usefixtures("bad_files")
def test_a_localized_replay_gives_the_pose_in_the_map_frame(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["replay", "good.csv", "--model", "drum", "--localize", "--trajectory", "path.csv", "--json", "x.json"]
    assert run_command(words) == DONE
    assert "localizing: the robot is at" in capsys.readouterr().out
    result = json.loads(Path("x.json").read_bytes())
    assert result["frame"] == "map"
    assert result["pose"]["status"] == "localizing"
    assert len(result["pose"]["covariance"]) == 3
    header, row = Path("path.csv").read_text("utf-8").splitlines()
    assert header == "t,x,y,theta,sxx,sxy,syy,stt,status"
    assert row.split(",")[-1] == "localizing"
    assert [float(v) for v in row.split(",")[1:4]] == [result["pose"][name] for name in ("x", "y", "theta")]


@pytest.mark.usefixtures("bad_files")
def test_polylines_are_in_the_summary(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    words = ["replay", "good.csv", "--model", "drum", "--json", "x.json"]
    assert run_command(words) == DONE
    assert json.loads(Path("x.json").read_bytes())["polylines"] == []
    report_bend(monkeypatch)
    assert run_command([*words, "--force"]) == DONE
    assert json.loads(Path("x.json").read_bytes())["polylines"] == [
        {"number": 3, "points": BEND.points.tolist(), "probability": 0.9}
    ]
    assert "1 polyline of what is not straight, 2.0 m long together\n" in capsys.readouterr().out


@pytest.mark.usefixtures("bad_files")
def test_a_trajectory_needs_the_map_frame(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["replay", "good.csv", "--trajectory", "path.csv"]) == WRONG_CALL
    assert "--localize" in capsys.readouterr().err


@pytest.mark.usefixtures("bad_files")
def test_a_map_needs_localize_and_a_surface(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["replay", "good.csv", "--map", "hallway"]) == WRONG_CALL
    assert "--localize" in capsys.readouterr().err
    Path("empty.toml").write_text("[start]\nx_m = 0.0\n", "utf-8")
    assert run_command(["replay", "good.csv", "--localize", "--map", "empty.toml"]) == WRONG_CALL
    assert "empty.toml: perception.localization: known_room has no surface" in capsys.readouterr().err


@pytest.mark.usefixtures("bad_files")
def test_a_replay_in_a_known_room_starts_without_a_pose() -> None:
    words = ["replay", "good.csv", "--localize", "--map", "hallway", "--trajectory", "path.csv", "--json", "x.json"]
    assert run_command(words) == DONE
    result = json.loads(Path("x.json").read_bytes())
    assert "frame" not in result  # the robot's place is not known yet: objects are in odometry's frame
    assert (result["pose"]["status"], result["pose"]["probability"]) == ("localizing", 0.0)
    assert Path("path.csv").read_text("utf-8").splitlines()[1].split(",")[-1] == "localizing"


@pytest.mark.usefixtures("bad_files")
@pytest.mark.parametrize("file", ["nowhere.csv", "broken.toml"])
def test_a_log_that_cannot_be_read_is_refused_before_kernels_are_compiled(
    file: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def compiled(*_: object) -> None:
        raise AssertionError("kernels were prepared first")

    monkeypatch.setattr("runtime.cli.commands.replay.replay_ring_log.prepare_kernels", compiled)
    assert run_command(["replay", file]) == WRONG_CALL


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
