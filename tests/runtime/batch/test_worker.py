"""One run of a study: the same figures as the commands that make one, and failures that are results."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from config.errors import DONE, FAILED, UserError
from config.load import load_settings
from config.settings import Settings
from config.study import StudyConfig, VaryConfig
from config.world import WorldConfig
from runtime.batch.runs import Run, expand
from runtime.batch.worker import Row, map_figures, mean_sigma, run_one, truth_figures
from runtime.cli.app import run_command
from runtime.cycle.summary import ObjectRow
from runtime.simulation.evaluation import DrumRow


def runs_of(**fields: Any) -> list[Run]:
    return expand(StudyConfig.model_validate(fields), Path())


@pytest.mark.compiled
def test_a_scene_gives_what_the_experiment_gives(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (run,) = runs_of(scenes=["clean"], first_seed=0)
    row = run_one(run)
    path = tmp_path / "x.json"
    assert run_command(["experiment", "hallway", "--scene", "clean", "--json", str(path)]) == DONE
    outcome = json.loads(path.read_text())
    capsys.readouterr()
    assert (row["key"], row["status"], row["truth"], row["found"]) == (run.key, "done", 6, 6)
    assert (row["false"], row["max_error_m"]) == (outcome["false"], outcome["max_error"])
    assert row["mean_error_m"] == pytest.approx(outcome["mean_error"])


@pytest.mark.compiled
def test_withheld_readings_of_any_recording_are_predicted(hall_run: Path, hall_log: Path, tmp_path: Path) -> None:
    for file in (hall_run, hall_log):
        (tmp_path / file.name).symlink_to(file)
    for run in runs_of(recordings=str(tmp_path), objectives=["predicted_nat"]):
        row = run_one(run)
        assert row["predicted_nat"] > 0.5, run.subject
        assert row["objects"] >= 1


def test_a_model_that_is_not_round_has_a_truth_too() -> None:
    world = WorldConfig.model_validate(
        {"box": [{"x_m": 2.0, "y_m": 1.0, "width_m": 0.6, "depth_m": 0.6}], "start": {"x_m": -1.0}}
    )
    settings = load_settings("hallway", models=["box"])
    objects = [
        ObjectRow(model=settings.models[0].name, x=x, y=1.0, theta=0.0, sigma=0.01, support=9, score=1.0)
        for x in (3.0, 6.0)
    ]
    figures = map_figures(objects, world, settings)
    assert (figures["truth"], figures["found"], figures["false"], figures["max_error_m"]) == (1, 1, 1, 0.0)


@pytest.mark.soak
@pytest.mark.compiled
def test_recordings_are_replayed_with_other_settings(hall_run: Path, hall_log: Path, tmp_path: Path) -> None:
    for file in (hall_run, hall_log):
        (tmp_path / file.name).symlink_to(file)
    near = VaryConfig(setting="perception.map.age_max_s", values=(120.0, 0.5))
    runs = runs_of(recordings=str(tmp_path), truth="hallway", sets=["perception.method=paper"], vary=(near,))
    rows = {(Path(run.subject).suffix, run.varied[near.setting]): run_one(run) for run in runs}
    assert len(rows) == 4
    for suffix in (".mcap", ".csv"):
        assert rows[suffix, 120.0]["objects"] >= 1
        assert rows[suffix, 0.5]["objects"] == 0, "no segment lives long enough"
        assert rows[suffix, 120.0]["truth"] == 6
        assert rows[suffix, 120.0]["mean_sigma_m"] is not None


def test_a_drive_that_did_not_arrive_is_a_result(monkeypatch: pytest.MonkeyPatch) -> None:
    def stopped(*_: object) -> Row:
        raise UserError("seed 3: the robot stopped", FAILED)

    monkeypatch.setattr("runtime.batch.worker.prepared_settings", Settings.model_validate_json)
    monkeypatch.setattr("runtime.simulation.evaluation.run_seed", stopped)
    (run,) = runs_of(worlds=["hallway"], first_seed=3)
    row = run_one(run)
    assert (row["status"], row["reason"], "recall" in row) == ("failed", "seed 3: the robot stopped", False)


def test_a_recording_that_cannot_be_read_is_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("runtime.batch.worker.prepared_settings", Settings.model_validate_json)
    (tmp_path / "log.csv").write_text("nothing\n")
    (run,) = runs_of(recordings=str(tmp_path))
    with pytest.raises(UserError, match=r"log\.csv"):
        run_one(run)


def test_figures_without_anything_found() -> None:
    missed: DrumRow = {"truth": (0.0, 0.0), "estimate": None, "error": None}
    assert truth_figures([missed], 2) == {
        "truth": 1, "found": 0, "recall": 0.0, "f1": 0.0, "false": 2, "mean_error_m": None, "max_error_m": None,
    }  # fmt: skip
    assert truth_figures([], 0)["recall"] is None
    assert truth_figures([], 0)["f1"] is None
    found: DrumRow = {"truth": (0.0, 0.0), "estimate": (0.0, 0.1), "error": 0.1}
    assert truth_figures([found, found, missed], 1)["f1"] == pytest.approx(2.0 * 2 / (3 + 2 + 1))
    assert mean_sigma([]) is None
