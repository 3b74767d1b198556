"""Tests of `echolocate replay` of a recording: verification, spans, speed, and comparison with other settings."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from config.errors import DONE, WRONG_CALL
from runtime.analysis.comparison import RunOutcome
from runtime.cli.app import run_command
from runtime.cli.commands.replay import replay_recording
from runtime.cli.commands.replay.replay_recording import errors_line, other_settings
from runtime.recording.reader import open_recording
from runtime.recording.replayer import GAP_MAX_S
from tests.polylines import BEND, report_bend
from tests.recorded import SECONDS, spoil, write_with_gap


def test_a_verified_replay_has_no_differences(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    summary = tmp_path / "summary.json"
    assert run_command(["replay", str(run), "--verify", "--json", str(summary)]) == DONE
    read = json.loads(summary.read_bytes())
    assert (read["cycles"], read["verify"]["differences"], read["verify"]["first"]) == (240, 0, None)
    assert len(read["objects"]) >= 3
    assert "240 cycles from cycle 1 on, 0 differences, " in capsys.readouterr().out


def test_polylines_are_in_the_summary(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    summary = tmp_path / "summary.json"
    report_bend(monkeypatch)
    assert run_command(["replay", str(run), "--json", str(summary)]) == DONE
    assert json.loads(summary.read_bytes())["polylines"] == [
        {"number": 3, "points": BEND.points.tolist(), "probability": 0.9}
    ]
    assert "1 polyline of what is not straight, 2.0 m long together\n" in capsys.readouterr().out


def test_a_refused_keyframe_is_one_line_and_no_error(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, summary = tmp_path / "spoiled.mcap", tmp_path / "summary.json"
    first, *_ = spoil(run, path, {0}, lost={20})
    for more in ([], ["--json", str(summary)], ["--with", "hallway"]):
        assert run_command(["replay", str(path), *more]) == DONE
        lines = [line for line in capsys.readouterr().err.splitlines() if "refused" in line]
        assert len(lines) == 1
        assert f"the keyframe of cycle {first} is refused: canyon_map.firings is -7, expected 0 to" in lines[0]
    assert len(json.loads(summary.read_bytes())["verify"]["refused_keyframes"]) == 1


class VirtualTime:
    """Stands for the module `time`: to sleep moves the clock."""

    def __init__(self) -> None:
        self.host_s = 0.0

    def monotonic(self) -> float:
        return self.host_s

    def sleep(self, seconds: float) -> None:
        assert seconds > 0.0
        self.host_s += seconds


@pytest.fixture
def virtual_time(monkeypatch: pytest.MonkeyPatch) -> VirtualTime:
    virtual = VirtualTime()
    monkeypatch.setattr(replay_recording, "time", virtual)
    return virtual


def test_a_span_at_a_speed_is_paced(run: Path, virtual_time: VirtualTime, capsys: pytest.CaptureFixture[str]) -> None:
    """The sleeps add up to the span at that speed. It begins at the keyframe before, at most 2 s earlier."""
    assert run_command(["replay", str(run), "--from", "4", "--to", "8", "--speed", "2"]) == DONE
    assert 1.9 < virtual_time.host_s < 3.1
    assert ", 0 differences, " in capsys.readouterr().out


@pytest.mark.promise("P21")
@pytest.mark.parametrize("gap_s", [6.0, pytest.param(1e8, marks=pytest.mark.soak), -1e8])
def test_a_gap_in_time_is_reported_and_shortened(
    gap_s: float, run: Path, tmp_path: Path, virtual_time: VirtualTime, capsys: pytest.CaptureFixture[str],
    measured: Callable[[str], None],
) -> None:  # fmt: skip
    """A run of 12 s at ten times the speed takes 1.2 s, and a gap 0.3 s."""
    write_with_gap(run, tmp_path / "gap.mcap", 100, gap_s)
    assert run_command(["replay", str(tmp_path / "gap.mcap"), "--speed", "10"]) == DONE
    err = capsys.readouterr().err
    assert (f"no cycle for {gap_s:.0f} s before cycle 101: shown as 3 s\n" in err) == (gap_s > 0.0), err
    shown_s = SECONDS + (GAP_MAX_S if gap_s > 0.0 else 0.0)
    assert virtual_time.host_s == pytest.approx(shown_s / 10.0, abs=0.02)
    measured(f"{SECONDS:g} s with a gap of {gap_s:g} s, shown at 10 times the speed: {virtual_time.host_s:.2f} s")


def test_other_settings_are_compared(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["replay", str(run), "--set", "perception.method=paper"]) == DONE
    out = capsys.readouterr().out
    assert out.index("as it was") < out.index("with the other settings")
    assert out.count("of 6 drums") == 2
    assert out.splitlines()[-1] == "240 cycles; 0 with another command"
    for option in (["--verify"], ["--json", "summary.json"], ["--to", "3"]):
        assert run_command(["replay", str(run), *option, "--set", "perception.method=paper"]) == WRONG_CALL
        err = capsys.readouterr().err
        assert option[0] in err
        assert "for the recorded settings only" in err


def test_another_model_or_robot_leaves_the_other_recorded_settings(run: Path) -> None:
    with open_recording(run) as recording:
        recorded = recording.settings
        models = other_settings(recording, None, (), robot=None, models=["box"])
        robot = other_settings(recording, None, ("perception.method=paper",), robot="p3dx", models=())
    assert [model.name for model in models.models] == ["box"]
    assert models == recorded.model_copy(update={"models": models.models})
    assert (robot.ring.sensor_count, robot.perception.method) == (16, "paper")
    assert (robot.goal, robot.mission, robot.world) == (recorded.goal, recorded.mission, recorded.world)


def test_errors_in_one_line() -> None:
    run = RunOutcome(errors_m=[0.3048, None, 0.6096], false=1)
    assert errors_line(run, "ft") == "2 of 3 drums, 1 false; mean error 1.5000 ft, worst 2.0000 ft"
    assert errors_line(RunOutcome(errors_m=[None]), "m") == "0 of 1 drums, 0 false"
    assert errors_line(RunOutcome(), "m") == "0 objects"
