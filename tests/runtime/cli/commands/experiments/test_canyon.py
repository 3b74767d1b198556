"""Tests of `echolocate experiment canyon`: its table, its JSON, and options that it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from config.errors import DONE, WRONG_CALL
from config.settings import Settings
from runtime.cli.app import run_command
from runtime.cli.commands.experiments.canyon import REFLECTIONS, SCHEMAS
from runtime.simulation import canyon_trials
from runtime.simulation.canyon_trials import CanyonOutcome
from runtime.simulation.canyon_worlds import CanyonWorld


def test_command_prints_a_row_for_each_set_of_schemas(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    gains = []

    def drive(settings: Settings, place: CanyonWorld, _seed: int) -> CanyonOutcome:
        gains.append(settings.behaviors.leave_canyon.leave_canyon_gain)
        return CanyonOutcome(
            place.depth_m,
            place.width_m,
            arrived=True,
            entries=0,
            deepest_m=-1.0,
            contacts=0,
            way_m=12.0,
            shortest_m=10.0,
            time_s=50.0,
        )

    monkeypatch.setattr(canyon_trials, "drive", drive)
    path = tmp_path / "canyon.json"
    assert run_command(["experiment", "canyon", "--seeds", "2", "--json", str(path)]) == DONE
    assert len(gains) == 2 * len(SCHEMAS) * len(REFLECTIONS)
    rows = json.loads(path.read_text("utf-8"))["rows"]
    assert [row["schemas"] for row in rows] == [*SCHEMAS, *SCHEMAS]
    assert rows[0]["way"] == pytest.approx(1.2)
    assert "leave-canyon" in capsys.readouterr().out


def test_options_of_other_experiments_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["experiment", "canyon", "--out", "x"]) == WRONG_CALL
    assert "has worlds of its own" in capsys.readouterr().err
