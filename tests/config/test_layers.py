"""Tests that each error names the source of its value once, and that every problem is reported."""

from __future__ import annotations

import copy
from pathlib import Path

import pytest

from config.load import ConfigError, load_model
from tests.config.loading import problem, problems, write
from tests.config.toml_text import MODEL, ROBOT, WORLD

pytestmark = pytest.mark.usefixtures("elsewhere")


def test_each_error_names_the_source_of_its_value(tmp_path: Path) -> None:
    robot, world, model = copy.deepcopy(ROBOT), copy.deepcopy(WORLD), copy.deepcopy(MODEL)
    robot["ring"]["resolution_m"] = -1
    robot["body"]["radius"] = 1
    world["drum"][0]["radius_m"] = 0
    model["vertices_m"][1] = [1.0, "a"]
    files = {
        "robot": write(tmp_path / "robot.toml", robot),
        "world": write(tmp_path / "world.toml", world),
        "model": write(tmp_path / "model.toml", model),
    }
    run = write(
        tmp_path / "run.toml",
        {
            "robot": "robot.toml",
            "world": "world.toml",
            "models": ["box", "model.toml"],
            "ring": {"range_min_m": "near"},
            "cycle": {"rate_hz": 0},
            "preception": {},
        },
    )
    assert sorted(problems(run, ["body.synchro=1", "behaviors.arbiter.turn_gain=2"])) == sorted(
        [
            f"{files['robot']}: ring.resolution_m = -1: must be at least 0 (and below 1)",
            f'{run}: ring.range_min_m = "near": must be a number, not a string',
            "--set: body.synchro = 1: must be true or false, not an integer",
            f"{files['robot']}: body.radius: unknown key; did you mean radius_m?",
            f'{files["model"]}: vertices_m.1.1 = "a": must be a number, not a string',
            f"{files['world']}: drum.0.radius_m = 0: must be above 0 (and at most 100)",
            f"{run}: cycle.rate_hz = 0: must be at least 1 (and at most 200)",
            "--set: behaviors.arbiter.turn_gain: unknown key; did you mean turn_gain_per_s?",
            f"{run}: preception: unknown key; did you mean perception?",
        ]
    )


def test_the_order_of_problems_is_stable() -> None:
    changes = ["body.radius_m=0", "ring.count=1", "log.level=x", "cycle.x=1"]
    assert problems(None, changes) == problems(None, changes)
    assert sorted(problems(None, changes)) == sorted(problems(None, changes[::-1]))


def test_a_missing_key_is_the_enclosing_sections(tmp_path: Path) -> None:
    robot = copy.deepcopy(ROBOT)
    del robot["ring"]["range_max_m"], robot["body"]
    mine = write(tmp_path / "mine.toml", robot)
    run = write(tmp_path / "run.toml", {"robot": "mine.toml", "ring": {"resolution_m": 0}, "body": {"radius_m": 1}})
    assert problems(run) == [
        f"{mine}: ring.range_max_m: missing",
        f"{run}: body.speed_max_m_s: missing",
        f"{run}: body.turn_max_rad_s: missing",
    ]


def test_a_conflict_names_the_sources_of_all_its_values(tmp_path: Path) -> None:
    mine = write(tmp_path / "mine.toml", ROBOT)
    run = write(tmp_path / "run.toml", {"robot": "mine.toml", "ring": {"range_max_m": 5, "resolution_m": 0}})
    text = "ring: range_min_m 6.0 is not below range_max_m 5.0"
    assert problem(run, ["ring.range_min_m=6"]) == f"--set over {run}: {text}"
    assert problem(run, ["ring.range_min_m=6", "ring.range_max_m=5"]) == f"--set: {text}"
    text = "perception.segments: baseline_min_m 0.9 is not below baseline_max_m 0.5"
    assert problem(mine, ["perception.segments.baseline_min_m=0.9"]) == f"--set: {text}"


def test_a_conflict_in_a_model_file(tmp_path: Path) -> None:
    model = copy.deepcopy(MODEL)
    model["vertices_m"][1] = model["vertices_m"][0]
    mine = write(tmp_path / "mine.toml", model)
    with pytest.raises(ConfigError) as caught:
        load_model(mine)
    assert str(caught.value) == f"{mine}: vertex 1 [0.0, 0.0] repeats vertex 0"
    assert problem(models=[str(mine)]) == f"{mine}: vertex 1 [0.0, 0.0] repeats vertex 0"


def test_a_section_that_no_robot_file_may_have(tmp_path: Path) -> None:
    mine = write(tmp_path / "mine.toml", {**ROBOT, "cycle": {"rate_hz": 5}})
    run = write(tmp_path / "run.toml", {"robot": "mine.toml"})
    assert (
        problem(run)
        == f"{mine}: cycle: unknown key; known here: robot, ring, body, link, calibration, arcos, rflex, ros2"
    )


def test_too_many_problems_are_counted_not_listed(tmp_path: Path) -> None:
    run = write(tmp_path / "run.toml", "robot = 'denning'\n" + "".join(f"k{i} = 1\n" for i in range(300)))
    lines = problems(run)
    assert len(lines) == 101
    assert lines[-1] == "… and 200 problems more"


def test_entries_of_a_wrong_list_are_reported_once() -> None:
    assert problem(None, ["models.0.vertices_m=[[0, 1], [2]]"]) == "--set: models.0.vertices_m.1.1: missing"
    assert problem(None, ["ring.firing={sets=[[0, -1]]}"]).startswith("--set: ring.firing.sets.0.1 = -1: must be")


def test_a_replaced_table_has_the_source_of_its_new_values(tmp_path: Path) -> None:
    run = write(tmp_path / "run.toml", {"robot": "denning", "body": {"radius_m": 0.2}})
    lines = problems(run, ["body={radius_m=0, speed_max_m_s=1, turn_max_rad_s=-1}"])
    assert [line.split(" = ")[0] for line in lines] == ["--set: body.radius_m", "--set: body.turn_max_rad_s"]
