"""Names and paths of settings files, and the layers that they are merged in."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import pytest

from config.load import (
    ConfigError,
    list_shipped,
    load_any,
    load_model,
    load_robot,
    load_settings,
    load_world,
    with_known_room,
)
from config.model import ModelConfig
from config.settings import Settings
from config.world import StartConfig, WorldConfig
from tests.config.loading import problem, problems, write
from tests.config.toml_text import MODEL, ROBOT, WORLD, irregular

pytestmark = pytest.mark.usefixtures("elsewhere")

ROBOTS = ", ".join(list_shipped("robots"))


def test_a_name_finds_the_shipped_file_and_a_path_any_file(tmp_path: Path) -> None:
    write(tmp_path / "mine.toml", ROBOT)
    assert load_robot("mine.toml") == load_robot("./mine.toml") == load_robot(tmp_path / "mine.toml")
    assert load_robot("denning") != load_robot("mine.toml")
    write(tmp_path / "no_suffix", MODEL)
    assert load_model("./no_suffix").name == "corner"


def test_paths_in_a_run_start_at_its_folder(tmp_path: Path) -> None:
    write(tmp_path / "a/robots/mine.toml", ROBOT)
    write(tmp_path / "a/hall.toml", WORLD)
    write(tmp_path / "models/corner.toml", MODEL)
    run = write(
        tmp_path / "a/run.toml",
        {"robot": "robots/mine.toml", "world": "hall.toml", "models": ["../models/corner.toml", "box"]},
    )
    settings = load_settings(run)
    assert settings.body.radius_m == 0.4
    assert settings.world == load_world(tmp_path / "a/hall.toml")
    assert [m.name for m in settings.models] == ["corner", "box"]


def test_paths_on_the_command_line_start_at_the_working_directory(tmp_path: Path) -> None:
    write(tmp_path / "mine.toml", ROBOT)
    write(tmp_path / "hall.toml", WORLD)
    write(tmp_path / "a/run.toml", {"robot": "denning"})
    by_word = load_settings("a/run.toml", robot="mine.toml", world="hall.toml", models=["drum"])
    by_set = load_settings("a/run.toml", ["robot=mine.toml", "world=hall.toml", "models=drum"])
    assert by_word == by_set
    assert by_word.body.radius_m == 0.4
    assert [m.name for m in by_word.models] == ["drum"]


@pytest.mark.parametrize(
    ("load", "what", "near", "wrong"),
    [
        (load_robot, "robot", "denning", "dening"),
        (load_world, "world", "irregular", "Iregular"),
        (load_model, "model", "semicircle", "semi_circle"),
        (load_settings, "run", "hallway", "halway"),
    ],
)
def test_unknown_names(load: Any, what: str, near: str, wrong: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load(wrong)
    assert str(caught.value).startswith(f'{what} "{wrong}": no such {what}; did you mean {near}?; known {what}s: ')


def test_an_unknown_name_in_a_run_names_the_run_and_the_known_ones(tmp_path: Path) -> None:
    run = write(tmp_path / "run.toml", {"robot": "denning", "world": "xyz"})
    line = problem(run)
    assert line.startswith(f'{run}: world "xyz": no such world; known worlds: hallway, irregular, office, room')
    assert problem(robot="denig").startswith('command line: robot "denig": no such robot; did you mean denning?')
    assert problem(None, ["models.0=bix"]).startswith('--set: model "bix": no such model; did you mean box?')


def test_bare_name_of_an_existing_file(tmp_path: Path) -> None:
    write(tmp_path / "mine.toml", ROBOT)
    with pytest.raises(ConfigError, match=r"a file is given by its path: \./mine\.toml"):
        load_robot("mine")


def test_a_missing_file_is_reported_with_the_file_that_names_it(tmp_path: Path) -> None:
    assert problem("run.toml") == "run.toml: file not found; known runs: hallway, irregular, office, room"
    run = write(tmp_path / "run.toml", {"robot": "robots/mine.toml"})
    assert problem(run) == f"{tmp_path}/robots/mine.toml: file not found; named by {run}; known robots: {ROBOTS}"


def test_every_missing_file_is_reported(tmp_path: Path) -> None:
    run = write(tmp_path / "run.toml", {"robot": "a", "world": "b", "models": ["c", "box", "d"]})
    assert [line.split(":")[1] for line in problems(run)] == [' robot "a"', ' world "b"', ' model "c"', ' model "d"']


@pytest.mark.parametrize(
    ("key", "value", "text"),
    [
        ("robot", 5, "robot = 5: must be a name or a path (a string), not an integer"),
        ("world", True, "world = true: must be a name or a path (a string), not true or false"),
        ("models", 1.5, "models = 1.5: must be a list of names, not a number with a fraction"),
        ("models", ["box", 7], "models.1 = 7: must be a name or a path (a string), not an integer"),
        ("models", ["nowhere"] * 65, "models: may have at most 60 entries, has 65"),
        ("models", [], "models = []: needs at least one entry, has 0"),
    ],
)
def test_the_name_of_a_file_must_be_a_string(key: str, value: Any, text: str, tmp_path: Path) -> None:
    run = write(tmp_path / "run.toml", {"robot": "denning", key: value})
    assert problem(run) == f"{run}: {text}"


def test_a_run_overrides_the_robot_key_by_key(tmp_path: Path) -> None:
    run = write(
        tmp_path / "run.toml", {"robot": "denning", "ring": {"beam_half_angle_deg": 10}, "link": {"tries": 5}}
    )
    settings, robot = load_settings(run), load_robot("denning")
    assert settings.ring == robot.ring.model_copy(update={"beam_half_angle_deg": 10.0})
    assert settings.body == robot.body
    assert settings.link.tries == 5
    assert settings.link.baud == robot.link.baud


def test_the_defaults_are_the_papers_experiment(tmp_path: Path) -> None:
    settings = load_settings(write(tmp_path / "run.toml", {"robot": "denning"}))
    assert settings.world == load_world("hallway")
    assert settings.models == (load_model("semicircle"),)
    assert settings.perception == Settings.model_fields["perception"].default


def test_a_robot_file_alone_is_a_run(tmp_path: Path) -> None:
    assert load_settings(write(tmp_path / "mine.toml", ROBOT)).body.radius_m == 0.4


def test_a_run_without_a_robot(tmp_path: Path) -> None:
    run = write(tmp_path / "run.toml", {"perception": {"clusters": {"threshold_m": 1.0}}})
    assert problem(run).startswith(f"{run}: robot: missing; name a robot or a robot file; known robots: {ROBOTS}")


def test_one_model_needs_no_list(tmp_path: Path) -> None:
    run = write(tmp_path / "run.toml", {"robot": "denning", "models": "box"})
    assert [m.name for m in load_settings(run).models] == ["box"]


def test_two_models_of_one_name() -> None:
    assert problem(models=["box", "box"]).endswith("two models are named box: give each model a name of its own")


def test_a_firing_pattern_replaces_that_of_the_robot(tmp_path: Path) -> None:
    mine = write(tmp_path / "mine.toml", irregular(ROBOT))
    for firing in ("single", {"preset": "single"}):
        run = write(tmp_path / "run.toml", {"robot": "mine.toml", "ring": {"firing": firing}})
        assert load_settings(run).ring.firing.preset == "single"
        assert load_settings(run).ring.firing.sets is None
    run = write(tmp_path / "run.toml", {"robot": "mine.toml", "ring": {"firing": {"step_period_s": 0.2}}})
    slower = load_settings(run).ring.firing
    assert slower.model_copy(update={"step_period_s": 0.05}) == load_robot(mine).ring.firing


def test_a_preset_written_as_a_string_can_be_refined(tmp_path: Path) -> None:
    robot = copy.deepcopy(ROBOT)
    robot["ring"]["firing"] = "quadrants"
    mine = write(tmp_path / "mine.toml", robot)
    assert load_robot(mine).ring.firing.preset == "quadrants"
    firing = load_settings(mine, ["ring.firing.step_period_s=0.2"]).ring.firing
    assert (firing.preset, firing.step_period_s) == ("quadrants", 0.2)


def test_an_invalid_value_may_be_overridden_by_a_valid_one(tmp_path: Path) -> None:
    robot = copy.deepcopy(ROBOT)
    robot["body"]["radius_m"] = -1
    write(tmp_path / "mine.toml", robot)
    run = write(tmp_path / "run.toml", {"robot": "mine.toml", "body": {"radius_m": 0.2}})
    assert load_settings(run).body.radius_m == 0.2


def test_the_kind_of_a_file_follows_from_its_keys(tmp_path: Path) -> None:
    assert isinstance(load_any(write(tmp_path / "w.toml", WORLD)), WorldConfig)
    assert isinstance(load_any(write(tmp_path / "m.toml", MODEL)), ModelConfig)
    assert isinstance(load_any(write(tmp_path / "r.toml", ROBOT)), Settings)
    with pytest.raises(ConfigError, match=r"w\.toml: drum\.0\.x: unknown key"):
        load_any(write(tmp_path / "w.toml", "[[drum]]\nx = 1\nx_m=1\ny_m=2\nradius_m=1"))


def test_a_world_becomes_the_known_room(tmp_path: Path) -> None:
    settings = load_settings("hallway")
    found = with_known_room(settings, "irregular").perception.localization.known_room
    assert found is not None
    assert found.drum == load_world("irregular").drum
    assert found.start == StartConfig()
    empty = write(tmp_path / "empty.toml", "[start]\nx_m = 1.0\n")
    with pytest.raises(ConfigError, match=r"empty\.toml: .*known_room has no surface"):
        with_known_room(settings, empty)
    corrected = load_settings("hallway", ["perception.localization.correct_drift=true"])
    with pytest.raises(ConfigError, match="exclude each other"):
        with_known_room(corrected, "irregular")


@pytest.mark.parametrize(
    ("override", "text"),
    [
        ("perception.method=full", '--set: perception.method = "full": was renamed: write "bayes"'),
        ("perception.full.tracks_max=12", "--set: perception.full: was renamed: call it perception.bayes"),
    ],
)
def test_a_former_name_is_refused_with_the_new_one(override: str, text: str) -> None:
    """Settings files of older versions say `full` for the Bayesian method."""
    with pytest.raises(ConfigError) as caught:
        load_settings("hallway", [override])
    assert caught.value.problems == (text,)
