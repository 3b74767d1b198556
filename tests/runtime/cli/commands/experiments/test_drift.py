"""Tests of `echolocate experiment drift`: its table, its JSON, and options that it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from config.errors import DONE, WRONG_CALL
from config.settings import Settings
from config.world import OdometryConfig
from runtime.cli.app import run_command
from runtime.simulation import drift_trials
from runtime.simulation.drift_trials import LEVELS, DriftOutcome

Driven = list[tuple[OdometryConfig, int, bool]]


@pytest.fixture
def driven(monkeypatch: pytest.MonkeyPatch) -> Driven:
    """Put a fixed outcome in place of each drive, and return the calls."""
    calls: Driven = []

    def drive(settings: Settings, errors: OdometryConfig, seed: int, *, corrected: bool) -> DriftOutcome:
        assert len(settings.ring.mounts) == 24
        calls.append((errors, seed, corrected))
        more = (2.9, 1.8, 0.001, -0.002) if corrected else ()
        return DriftOutcome((0.003, 0.005), 1, 2, 0.01, 0.02, *more)

    monkeypatch.setattr(drift_trials, "drive", drive)
    return calls


def test_command_prints_the_table(driven: Driven, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "drift.json"
    assert run_command(["experiment", "drift", "--seeds", "2", "--json", str(path)]) == DONE
    assert driven == [
        (errors, seed, corrected) for errors in LEVELS for corrected in (False, True) for seed in (0, 1)
    ]
    rows = json.loads(path.read_bytes())["levels"]
    assert [row["corrected"] for row in rows] == [False, True] * len(LEVELS)
    assert rows[1]["missed"] == 2
    assert "eight drums" in capsys.readouterr().out


@pytest.mark.parametrize("words", [["--scene", "clean"], ["--world", "hallway"], ["--out", "folder"]])
def test_a_hall_of_ones_own_is_refused(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["experiment", "drift", *words]) == WRONG_CALL
    assert "--scene" in capsys.readouterr().err
