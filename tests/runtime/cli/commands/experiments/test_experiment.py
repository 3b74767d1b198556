"""Tests of `echolocate experiment`: the paper's Table 2, the files of a recorded experiment, and scenes."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from config.errors import DONE, FAILED, WRONG_CALL, UserError
from config.load import load_settings
from runtime.analysis.plots import animation
from runtime.cli.app import run_command
from runtime.cli.commands.experiments.experiment import Experiment
from runtime.recording.reader import open_recording
from runtime.simulation.evaluation import stop_at_leg_end
from runtime.simulation.scenes import halls

FT = 0.3048
TABLE_2 = [(1.0, 4.0), (4.0, 4.0), (7.0, 4.0), (1.0, -4.0), (4.0, -4.0), (7.0, -4.0)]


def experiment(tmp_path: Path, *arguments: str) -> dict[str, Any]:
    path = tmp_path / "outcome.json"
    assert run_command(["experiment", *arguments, "--json", str(path), "--force"]) == DONE
    got = json.loads(path.read_bytes())
    assert isinstance(got, dict)
    return got


def test_a_single_setting_has_the_last_word_on_the_method() -> None:
    assert Experiment(overrides=("perception.method=paper",)).sets[-1] == "perception.method=paper"


def found(rows: list[dict[str, Any]]) -> int:
    return sum(row["estimate"] is not None for row in rows)


@pytest.mark.parametrize("what", [["hallway"], ["hallway", "--scene", "clean"], ["budget"]])
def test_a_summary_that_cannot_be_written_is_refused_before_the_first_drive(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, what: list[str]
) -> None:
    for module in ("experiment", "budget"):
        prepare = f"runtime.cli.commands.experiments.{module}.prepare_kernels"
        monkeypatch.setattr(prepare, lambda *_: pytest.fail("it went on"))
    assert run_command(["experiment", *what, "--json", str(tmp_path / "no" / "x")]) == FAILED
    assert "cannot be written" in capsys.readouterr().err


def test_the_papers_hallway(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    outcome = experiment(tmp_path, "hallway", "--method", "paper")
    assert set(outcome) >= {"drums", "false", "mean_error", "max_error", "times_real_time"}
    truths = sorted(tuple(round(v / FT, 6) for v in row["truth"]) for row in outcome["drums"])
    assert truths == sorted(TABLE_2)
    assert found(outcome["drums"]) == 6
    assert outcome["false"] == 0
    assert outcome["mean_error"] <= 0.25 * FT
    assert outcome["max_error"] <= 0.35 * FT
    errors = [row["error"] for row in outcome["drums"]]
    assert outcome["max_error"] == max(errors)
    assert outcome["mean_error"] == pytest.approx(sum(errors) / 6)
    shown = capsys.readouterr()
    assert "6 of 6 drums found, 0 false" in shown.out
    assert shown.err == ""


@pytest.mark.compiled
@pytest.mark.parametrize(
    ("method", "least", "is_replayed"),
    [
        ("paper", 4, False),
        *(pytest.param(*one, True, marks=pytest.mark.soak) for one in (("paper", 4), ("bayes", 7))),
    ],
)
def test_an_experiment_leaves_recording_figures_and_page(
    method: str,
    least: int,
    is_replayed: bool,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(animation, "FRAMES_MAX", 2)
    monkeypatch.setattr("runtime.analysis.plots.figure_files.FORMATS", ("svg",))
    out = tmp_path / "out"
    outcome = experiment(tmp_path, "irregular", "--method", method, "--seeds", "2", "--out", str(out))
    reported = capsys.readouterr().out
    by_seed = [outcome["drums"][8 * k : 8 * k + 8] for k in range(2)]
    assert all(found(rows) >= least for rows in by_seed)
    spread = outcome["spread"]
    assert spread["seeds"] == 2
    assert spread["mean"] == pytest.approx(outcome["mean_error"], rel=0.2)
    assert spread["worst"] == outcome["max_error"]
    assert max(row["error"] or 0.0 for row in by_seed[spread["worst_seed"]]) == spread["worst"]
    assert 0.0 < spread["deviation"] < spread["worst"]
    assert "2 seeds: mean error" in reported
    files = {path.name for path in out.iterdir()}
    figures = {f"{name}.svg" for name in ("raw", "segments", "clusters", "models")}
    assert files >= {"irregular.mcap", "irregular.html", "overview.gif", *figures}
    assert all(str(out / name) in reported for name in files)
    # The recording is the run of seed 0, and the page lists its errors; its replay takes long.
    recorded = out / "irregular.mcap"
    assert not is_replayed or run_command(["replay", str(recorded), "--verify"]) == DONE
    with open_recording(recorded) as recording:
        assert recording.world == load_settings("irregular").world
    page = (out / "irregular.html").read_text("utf-8")
    truth = next(row for row in by_seed[0] if row["error"] is not None)
    assert f"{truth['error'] / FT:.3f}" in page
    assert "as the paper's Figure 13" in re.sub(r"<[^>]*>", "", page)


def test_a_scene_gives_table_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    outcome = experiment(tmp_path, "hallway", "--scene", "clean", "--method", "paper")
    assert {"drums", "false", "mean_error", "max_error", "times_real_time"} <= outcome.keys()
    assert [row["truth"] for row in outcome["drums"]] == [[d.x_m, d.y_m] for d in halls("clean")[0].world.drum]
    assert outcome["false"] == 0
    assert all(row["error"] < 0.25 * FT for row in outcome["drums"])
    assert outcome["max_error"] == max(row["error"] for row in outcome["drums"])
    assert "6 of 6 drums found, 0 false" in capsys.readouterr().out


def test_an_experiment_needs_an_end_and_drums(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    settings = load_settings("hallway")
    assert stop_at_leg_end(settings).behaviors.move_ahead.at_end == "stop"
    ahead = settings.behaviors.move_ahead.model_copy(update={"distance_m": None})
    endless = settings.model_copy(update={"behaviors": settings.behaviors.model_copy(update={"move_ahead": ahead})})
    with pytest.raises(UserError, match="the experiment needs an end"):
        stop_at_leg_end(endless)
    (tmp_path / "empty.toml").touch()
    assert run_command(["experiment", "hallway", "--world", str(tmp_path / "empty.toml")]) == WRONG_CALL
    assert "the world has no drum" in capsys.readouterr().err
