"""The runs of a study: every combination once, and keys that change with everything a result depends on."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import pytest

from config.errors import UserError
from config.files import ConfigError
from config.load import load_settings
from config.settings import Settings
from config.study import StudyConfig, VaryConfig
from config.world import WorldConfig
from runtime.batch.runs import expand

ANGLE = "ring.beam_half_angle_deg"
METHOD = "perception.method"
HERE = Path()


def study(**fields: Any) -> StudyConfig:
    return StudyConfig.model_validate({"scenes": ["clean"], **fields})


def vary(setting: str, *values: Any) -> VaryConfig:
    return VaryConfig(setting=setting, values=values)


def test_every_combination_is_run_once_with_its_settings() -> None:
    grid = study(scenes=["clean", "walls"], seeds=2, first_seed=5, vary=(vary(METHOD, "bayes", "paper"),
                                                                      vary(ANGLE, 8.0, 12.0)))  # fmt: skip
    runs = expand(grid, HERE)
    made = {(run.varied[METHOD], run.varied[ANGLE], run.subject, run.seed) for run in runs}
    assert made == set(itertools.product(("bayes", "paper"), (8.0, 12.0), ("clean", "walls"), (5, 6)))
    assert len(runs) == len({run.key for run in runs}) == 16
    for run in runs:
        settings = Settings.model_validate_json(run.settings)
        assert (settings.perception.method, settings.ring.beam_half_angle_deg) == (run.varied[METHOD],
                                                                                  run.varied[ANGLE])  # fmt: skip


def test_a_study_that_has_grown_keeps_the_keys_of_its_runs() -> None:
    before = {run.key for run in expand(study(seeds=2), HERE)}
    default = load_settings("hallway").ring.beam_half_angle_deg
    grown = expand(study(seeds=3, scenes=["walls", "clean"], vary=(vary(ANGLE, 8.0, default),)), HERE)
    kept = [run for run in grown if run.key in before]
    assert {run.varied[ANGLE] for run in kept} == {default}
    assert len(kept) == 2


def test_a_key_changes_with_everything_that_a_result_depends_on(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("t,x,y,theta,r00\n0,0,0,0,1\n")
    (tmp_path / "sub").mkdir()
    recordings = {"scenes": [], "recordings": str(tmp_path)}
    studies = [
        study(),
        study(first_seed=1),
        study(scenes=["walls"]),
        study(sets=["ring.beam_half_angle_deg=8.0"]),
        study(models=["drum"]),
        study(scenes=[], worlds=["hallway"]),
        study(scenes=[], worlds=["room"]),
        study(**recordings),
        study(**recordings, truth="hallway"),
        study(**recordings, objectives=["predicted_nat"]),
    ]
    keys = [run.key for one in studies for run in expand(one, HERE)]
    (tmp_path / "log.csv").write_text("t,x,y,theta,r00\n0,0,0,0,2\n")
    keys += [run.key for run in expand(study(**recordings), HERE)]
    assert len(set(keys)) == len(keys) == 11


def test_each_recording_may_have_a_truth_of_its_own(tmp_path: Path) -> None:
    for name in ("a", "sub/b"):
        (tmp_path / "logs" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "truth" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "logs" / f"{name}.csv").write_text(f"t,x,y,theta,r00\n0,0,0,0,{len(name)}\n")
        (tmp_path / "truth" / f"{name}.toml").write_text(f"[start]\nx_m = {len(name)}.0\n")
    one = study(scenes=[], recordings="logs", truth="truth")
    truths = {Path(run.subject).stem: run.truth or "" for run in expand(one, tmp_path)}
    starts = {name: WorldConfig.model_validate_json(truth).start.x_m for name, truth in truths.items()}
    assert starts == {"a": 1.0, "b": 5.0}
    (tmp_path / "truth" / "a.toml").unlink()
    with pytest.raises(ConfigError, match=r"a\.toml"):
        expand(one, tmp_path)


def test_a_link_to_a_recording_elsewhere_is_one_of_the_folder(tmp_path: Path) -> None:
    (tmp_path / "disk.csv").write_text("t,x,y,theta,r00\n0,0,0,0,1\n")
    for name in ("logs", "truth"):
        (tmp_path / name).mkdir()
    (tmp_path / "logs" / "a.csv").symlink_to(tmp_path / "disk.csv")
    (tmp_path / "truth" / "a.toml").write_text("[start]\nx_m = 7.0\n")
    (run,) = expand(study(scenes=[], recordings="logs", truth="truth"), tmp_path)
    assert run.subject == str(tmp_path / "logs" / "a.csv")
    assert WorldConfig.model_validate_json(run.truth or "").start.x_m == 7.0


def test_a_recording_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    (tmp_path / "bad.csv").symlink_to("/proc/self/mem")  # its first bytes cannot be read
    with pytest.raises(ConfigError, match=r"bad\.csv: cannot be read: Input/output error; check it"):
        expand(study(scenes=[], recordings=str(tmp_path)), HERE)


def test_paths_are_relative_to_the_study(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text("[[drum]]\nx_m = 2.0\ny_m = 1.0\nradius_m = 0.3\n")
    (run,) = expand(study(scenes=[], worlds=["mine.toml"]), tmp_path)
    world = Settings.model_validate_json(run.settings).world
    assert world is not None
    assert [drum.x_m for drum in world.drum] == [2.0]


def test_a_drive_ends_with_its_leg() -> None:
    (run,) = expand(study(scenes=[], worlds=["hallway"]), HERE)
    assert Settings.model_validate_json(run.settings).behaviors.move_ahead.at_end == "stop"


@pytest.mark.parametrize(
    ("fields", "problem"),
    [
        ({"scenes": ["cleam"]}, "did you mean clean"),
        ({"vary": (vary("ring.beams", 1),)}, "ring.beams"),
        ({"vary": (vary(ANGLE, 8.0, "wide"),)}, "beam_half_angle_deg"),
        ({"scenes": [], "recordings": "nowhere"}, "no recording"),
        ({"seeds": 1_000_000, "vary": (vary(ANGLE, 8.0, 12.0),)}, "2,000,000 runs"),
    ],
)
def test_what_cannot_be_run_is_said_before_anything_runs(fields: dict[str, Any], problem: str) -> None:
    with pytest.raises((ConfigError, UserError), match=problem):
        expand(study(**fields), HERE)
