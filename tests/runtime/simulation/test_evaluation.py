"""The figures: the paper's Table 2 in virtual time, the irregular hallway, and one seed one result.

Seeds 101 and 202 were not looked at while the constants were chosen.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from config.errors import DONE, FAILED, WRONG_CALL, UserError
from config.load import load_settings
from config.settings import Settings
from config.world import WorldConfig
from runtime.analysis.plots import animation
from runtime.cli.app import run_command
from runtime.cli.commands.experiment import stop_at_leg_end
from runtime.recording.reader import open_recording
from runtime.simulation.evaluation import run_seed, summarise

pytestmark = pytest.mark.compiled

FT = 0.3048
TABLE_2 = [(1.0, 4.0), (4.0, 4.0), (7.0, 4.0), (1.0, -4.0), (4.0, -4.0), (7.0, -4.0)]


def experiment(tmp_path: Path, *arguments: str) -> dict[str, Any]:
    path = tmp_path / "outcome.json"
    assert run_command(["experiment", *arguments, "--json", str(path)]) == DONE
    got = json.loads(path.read_bytes())
    assert isinstance(got, dict)
    return got


def found(outcome: dict[str, Any]) -> int:
    return sum(row["estimate"] is not None for row in outcome["drums"])


def settings_of(name: str) -> tuple[Settings, WorldConfig]:
    settings = stop_at_leg_end(load_settings(name))
    assert settings.world is not None
    return settings, settings.world


def test_the_papers_hallway(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    outcome = experiment(tmp_path, "hallway", "--method", "paper")
    assert set(outcome) >= {"drums", "false", "mean_error", "max_error", "times_real_time"}
    truths = sorted(tuple(round(v / FT, 6) for v in row["truth"]) for row in outcome["drums"])
    assert truths == sorted(TABLE_2)
    assert found(outcome) == 6
    assert outcome["false"] == 0
    assert outcome["mean_error"] <= 0.25 * FT
    assert outcome["max_error"] <= 0.35 * FT
    errors = [row["error"] for row in outcome["drums"]]
    assert outcome["max_error"] == max(errors)
    assert outcome["mean_error"] == pytest.approx(sum(errors) / 6)
    shown = capsys.readouterr()
    assert "6 of 6 drums found, 0 false" in shown.out
    assert shown.err == ""


def test_an_experiment_leaves_recording_pictures_and_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(animation, "FRAMES_MAX", 2)
    out = tmp_path / "out"
    outcome = experiment(tmp_path, "irregular", "--seeds", "3", "--out", str(out))
    reported = capsys.readouterr().out
    spread = outcome["spread"]
    assert spread["seeds"] == 3
    assert spread["mean"] == pytest.approx(outcome["mean_error"], rel=0.2)
    assert spread["worst"] == outcome["max_error"]
    of_worst = outcome["drums"][8 * spread["worst_seed"] : 8 * spread["worst_seed"] + 8]
    assert max(row["error"] or 0.0 for row in of_worst) == spread["worst"]
    assert 0.0 < spread["deviation"] < spread["worst"]
    assert "3 seeds: mean error" in reported
    files = {path.name for path in out.iterdir()}
    kinds = ("svg", "pdf", "png")
    pictures = {f"{name}.{kind}" for name in ("raw", "segments", "clusters", "models") for kind in kinds}
    assert files >= {"irregular.mcap", "irregular.html", "overview.gif", *pictures}
    assert all(str(out / name) in reported for name in files)
    recorded = out / "irregular.mcap"
    assert run_command(["replay", str(recorded), "--verify"]) == DONE
    with open_recording(recorded) as recording:
        assert recording.world == load_settings("irregular").world
    # The recording is the run of seed 0, and the page lists its errors.
    page = (out / "irregular.html").read_text("utf-8")
    truth = next(row for row in outcome["drums"][:8] if row["error"] is not None)
    assert f"{truth['error'] / FT:.3f}" in page
    assert "as the paper's Figure 13" in re.sub(r"<[^>]*>", "", page)


def test_scenes_record_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["experiment", "hallway", "--scene", "clean", "--out", str(tmp_path)]) == WRONG_CALL
    assert "nothing to record" in capsys.readouterr().err


def test_the_same_seed_gives_the_same_outcome(tmp_path: Path) -> None:
    one, other = (experiment(tmp_path, "irregular", "--seeds", "1") for _ in range(2))
    timing = {"times_real_time", "cycle_us"}
    assert timing < set(one)
    assert {k: v for k, v in one.items() if k not in timing} == {k: v for k, v in other.items() if k not in timing}


def test_another_seed_gives_another_outcome() -> None:
    settings, world = settings_of("irregular")
    assert run_seed(settings, world, 5).rows != run_seed(settings, world, 6).rows


def test_the_irregular_hallway_with_one_per_cent_noise(tmp_path: Path) -> None:
    _, world = settings_of("irregular")
    assert len(world.drum) == 8
    assert world.acoustics.noise_relative == 0.01
    outcome = experiment(tmp_path, "irregular", "--seeds", "3")
    assert len(outcome["drums"]) == 24
    for k in range(3):
        of_seed = {**outcome, "drums": outcome["drums"][8 * k : 8 * k + 8]}
        assert found(of_seed) >= 7, f"seed {k}"


@pytest.mark.parametrize("seed", [101, 202])
def test_the_irregular_hallway_on_seeds_no_one_chose(seed: int) -> None:
    outcome = summarise([run_seed(*settings_of("irregular"), seed)])
    assert sum(row["estimate"] is not None for row in outcome["drums"]) >= 7
    assert outcome["false"] <= 1


def test_a_robot_that_does_not_come_through_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    """A wall across the hallway."""
    monkeypatch.setattr("runtime.simulation.evaluation.SECONDS_MAX", 40.0)
    settings, world = settings_of("hallway")
    wall = {"wall": [{"x1_m": 0.5, "y1_m": -9.0, "x2_m": 0.5, "y2_m": 9.0}]}
    shut = WorldConfig.model_validate({**world.model_dump(), **wall})
    with pytest.raises(UserError, match=r"^seed 3: the robot ") as caught:
        run_seed(settings, shut, 3)
    assert caught.value.exit_code == FAILED
