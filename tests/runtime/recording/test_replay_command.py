"""`echolocate replay` with other settings, at a chosen speed, and on files that cannot be replayed."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from config.errors import DONE, FAILED, WRONG_CALL
from runtime.cli.app import run_command


def test_comparison_with_other_settings(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["replay", str(run), "--set", "perception.method=paper", "--set", "cycle.rate_hz=20"]) == DONE
    out = capsys.readouterr().out
    assert out.index("as it was") < out.index("with the other settings")
    assert out.count("of 6 drums") == 2
    assert "0 with another command" in out


@pytest.mark.compiled
def test_other_settings_may_give_other_commands(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    avoid = "behaviors.avoid_static_obstacle.avoid_obstacle_sphere_m=2.0"
    assert run_command(["replay", str(run), "--set", avoid]) == DONE
    assert " 0 with another command" not in capsys.readouterr().out


def error_message(arguments: list[str], capsys: pytest.CaptureFixture[str], code: int) -> str:
    assert run_command(arguments) == code
    err = capsys.readouterr().err
    assert err.startswith("echolocate: ")
    assert err.count("\n") == 1, err
    return err


def test_contradictory_arguments_are_refused(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "--to" in error_message(["replay", str(run), "--from", "5", "--to", "4"], capsys, WRONG_CALL)
    assert "--speed" in error_message(["replay", str(run), "--speed", "0"], capsys, WRONG_CALL)
    assert "--verify" in error_message(["replay", str(run), "--verify", "--with", "irregular"], capsys, WRONG_CALL)
    assert "warp" in error_message(["replay", str(run), "--set", "warp=9"], capsys, WRONG_CALL)
    assert "itself" in error_message(["recover", str(run), "--out", str(run)], capsys, WRONG_CALL)
    assert "nowhere" in error_message(["recover", str(run), "--out", str(tmp_path / "nowhere" / "x")], capsys, FAILED)
    (tmp_path / "x.csv").write_text("t,x,y,theta,r00\n0,0,0,0,1\n")
    assert "ring log" in error_message(["replay", str(tmp_path / "x.csv"), "--verify"], capsys, WRONG_CALL)


@pytest.mark.compiled
def test_a_replay_at_a_speed_is_not_faster(run: Path) -> None:
    """Three seconds of the run at five times the speed take 0.6 s at least."""
    began_s = time.monotonic()
    assert run_command(["replay", str(run), "--verify", "--speed", "5", "--from", "8", "--to", "11"]) == DONE
    assert time.monotonic() - began_s > 0.5
