"""Layers, names and paths, --set, and the file an error names."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import pytest

from config.load import ConfigError, load_any, load_model, load_robot, load_settings, load_world
from config.model import ModelConfig
from config.settings import Settings
from config.world import WorldConfig
from tests.config.toml_text import MODEL, ROBOT, WORLD, document, irregular


def write(path: Path, table: dict[str, Any] | str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(table if isinstance(table, str) else document(table), encoding="utf-8")
    return path


def problems(*args: Any, **kwargs: Any) -> list[str]:
    with pytest.raises(ConfigError) as caught:
        load_settings(*args, **kwargs)
    assert str(caught.value).splitlines() == list(caught.value.problems)
    return list(caught.value.problems)


def problem(*args: Any, **kwargs: Any) -> str:
    lines = problems(*args, **kwargs)
    assert len(lines) == 1, lines
    return lines[0]


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


# --- names and paths


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
    assert line.startswith(f'{run}: world "xyz": no such world; known worlds: hallway, irregular')
    assert problem(robot="denig").startswith('command line: robot "denig": no such robot; did you mean denning?')
    assert problem(None, ["models.0=bix"]).startswith('--set: model "bix": no such model; did you mean box?')


def test_a_bare_name_beside_a_file_of_that_name(tmp_path: Path) -> None:
    write(tmp_path / "mine.toml", ROBOT)
    with pytest.raises(ConfigError, match=r"a file is given by its path: \./mine\.toml"):
        load_robot("mine")


def test_a_missing_file_says_who_named_it_and_what_is_known(tmp_path: Path) -> None:
    assert problem("run.toml") == "run.toml: file not found; known runs: hallway, irregular"
    run = write(tmp_path / "run.toml", {"robot": "robots/mine.toml"})
    assert problem(run) == f"{tmp_path}/robots/mine.toml: file not found; named by {run}; known robots: denning"


def test_every_missing_file_is_told(tmp_path: Path) -> None:
    run = write(tmp_path / "run.toml", {"robot": "a", "world": "b", "models": ["c", "box", "d"]})
    assert [line.split(":")[1] for line in problems(run)] == [' robot "a"', ' world "b"', ' model "c"', ' model "d"']


@pytest.mark.parametrize(
    ("key", "value", "text"),
    [
        ("robot", 5, "robot = 5: must be a name or a path (a string), not an integer"),
        ("world", True, "world = true: must be a name or a path (a string), not true or false"),
        ("models", 1.5, "models = 1.5: must be a list of names, not a number with a fraction"),
        ("models", ["box", 7], "models.1 = 7: must be a name or a path (a string), not an integer"),
        ("models", ["nowhere"] * 65, "models: may have at most 64 entries, has 65"),
        ("models", [], "models = []: needs at least one entry, has 0"),
    ],
)
def test_what_names_a_file_must_be_a_name(key: str, value: Any, text: str, tmp_path: Path) -> None:
    run = write(tmp_path / "run.toml", {"robot": "denning", key: value})
    assert problem(run) == f"{run}: {text}"


# --- layers


def test_a_run_overrides_the_robot_key_by_key(tmp_path: Path) -> None:
    run = write(
        tmp_path / "run.toml", {"robot": "denning", "ring": {"beam_half_angle_deg": 10}, "link": {"tries": 5}}
    )
    settings, robot = load_settings(run), load_robot("denning")
    assert settings.ring == robot.ring.model_copy(update={"beam_half_angle_deg": 10.0})
    assert settings.body == robot.body
    assert settings.link.tries == 5
    assert settings.link.baud == robot.link.baud


def test_what_a_run_leaves_out_is_the_papers_experiment(tmp_path: Path) -> None:
    settings = load_settings(write(tmp_path / "run.toml", {"robot": "denning"}))
    assert settings.world == load_world("hallway")
    assert settings.models == (load_model("semicircle"),)
    assert settings.perception == Settings.model_fields["perception"].default


def test_a_robot_file_alone_is_a_run(tmp_path: Path) -> None:
    assert load_settings(write(tmp_path / "mine.toml", ROBOT)).body.radius_m == 0.4


def test_a_run_without_a_robot(tmp_path: Path) -> None:
    run = write(tmp_path / "run.toml", {"perception": {"clusters": {"threshold_m": 1.0}}})
    assert problem(run).startswith(f"{run}: robot: missing; name a robot or a robot file; known robots: denning")


def test_one_model_may_stand_without_its_list(tmp_path: Path) -> None:
    run = write(tmp_path / "run.toml", {"robot": "denning", "models": "box"})
    assert [m.name for m in load_settings(run).models] == ["box"]


def test_two_models_of_one_name() -> None:
    assert problem(models=["box", "box"]).endswith("two models are named box: a report could not tell them apart")


def test_a_firing_table_with_its_own_pattern_replaces_the_robots(tmp_path: Path) -> None:
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


def test_a_value_overridden_with_a_good_one_does_no_harm(tmp_path: Path) -> None:
    robot = copy.deepcopy(ROBOT)
    robot["body"]["radius_m"] = -1
    write(tmp_path / "mine.toml", robot)
    run = write(tmp_path / "run.toml", {"robot": "mine.toml", "body": {"radius_m": 0.2}})
    assert load_settings(run).body.radius_m == 0.2


def test_the_kind_of_a_file_is_seen_from_its_keys(tmp_path: Path) -> None:
    assert isinstance(load_any(write(tmp_path / "w.toml", WORLD)), WorldConfig)
    assert isinstance(load_any(write(tmp_path / "m.toml", MODEL)), ModelConfig)
    assert isinstance(load_any(write(tmp_path / "r.toml", ROBOT)), Settings)
    with pytest.raises(ConfigError, match=r"w\.toml: drum\.0\.x: unknown key"):
        load_any(write(tmp_path / "w.toml", "[[drum]]\nx = 1\nx_m=1\ny_m=2\nradius_m=1"))


# --- --set


@pytest.mark.parametrize(
    ("text", "path", "value"),
    [
        ("ring.firing=quadrants", "ring.firing.preset", "quadrants"),
        ('ring.firing = "quadrants"', "ring.firing.preset", "quadrants"),
        ("ring.firing={preset='thirds', step_period_s=0.1}", "ring.firing.step_period_s", 0.1),
        ("ring.firing.step_period_s=0.1", "ring.firing.preset", "octets"),
        ("ring.firing={sets=[[0, 12], [6]]}", "ring.firing.sets", ((0, 12), (6,))),
        ("perception.clusters.threshold_m=0.5", "perception.clusters.threshold_m", 0.5),
        ("cycle.rate_hz=50", "cycle.rate_hz", 50.0),
        ("body.synchro=false", "body.synchro", False),
        ("log.level=debug", "log.level", "debug"),
        ("link.port=/dev/ttyUSB0", "link.port", "/dev/ttyUSB0"),
        ("link.port=COM3=x", "link.port", "COM3=x"),
        ("log.file='5'", "log.file", "5"),
        ("world.drum.0.x_m=1.5", "world.drum.0.x_m", 1.5),
        ("world.drum.5.radius_m=1", "world.drum.5.radius_m", 1.0),
        ("world.acoustics={dropout=0.5}", "world.acoustics.dropout", 0.5),
        ("world={}", "world.drum", ()),
        ("models.0=box", "models.0.name", "box"),
        ("models=[drum]", None, None),
        ("models=['drum', 'box']", "models.1.name", "box"),
        ("models.0.vertices_m.1.0=0.2", "models.0.vertices_m.1.0", 0.2),
    ],
)
def test_set(text: str, path: str | None, value: object) -> None:
    if path is None:
        assert problem(None, [text]).startswith(f"--set {text}: the value begins like a TOML list")
        return
    found: Any = load_settings(None, [text])
    for key in path.split("."):
        found = found[int(key)] if key.isdigit() else getattr(found, key)
    assert found == value
    assert type(found) is type(value)


def test_set_goes_over_the_files_and_later_over_earlier(tmp_path: Path) -> None:
    run = write(tmp_path / "run.toml", {"robot": "denning", "body": {"radius_m": 0.2}})
    assert load_settings(run, ["body.radius_m=0.3"]).body.radius_m == 0.3
    assert load_settings(run, ["body.radius_m=0.3", "body.radius_m=0.5"]).body.radius_m == 0.5
    assert load_settings(run, ["world.drum.7.x_m=9", "world=irregular"]).world.drum[7].x_m == 9.0  # type: ignore[union-attr]


@pytest.mark.parametrize("text", ["foo", "", "=", "=1", ".a=1", "a.=1", "a..b=1", " =1"])
def test_set_without_the_form(text: str) -> None:
    assert problem(None, [text]).startswith(f"--set {text}: must have the form section.key=value")


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("world.drum.6.x_m=1", "--set: world.drum.6.x_m: world.drum has 6 entries, numbered from 0"),
        ("world.drum.-1.x_m=1", "--set: world.drum.-1.x_m: world.drum is a list: its entries have numbers from 0"),
        ("world.drum.x_m=1", "--set: world.drum.x_m: world.drum is a list: its entries have numbers from 0, not the"),
        ("world.drum.²=1", "--set: world.drum.²: world.drum is a list"),
        ("world.drum.99999999999=1", "--set: world.drum.99999999999: world.drum is a list"),
        ("ring.count.x=1", "--set: ring.count.x: ring.count is a single value"),
        ("models.1=box", "--set: models.1: models has 1 entry"),
        ("a.b.c.d.e.f.g.h.i.j.k.l.m.n=1", "--set a.b.c.d.e.f.g.h.i.j.k.l.m.n=1: no setting lies that deep"),
        ("cycle.rate_hz=0x" + "f" * 300, "--set cycle.rate_hz=0xfff"),
        ("cycle.rate_hz=" + "9" * 6000, "--set cycle.rate_hz=999"),
        ("cycle.rate_hz=" + "[" * 4000, "--set cycle.rate_hz=[[["),
        ("cycle.rate_hz=1\nring = 5", "--set: cycle.rate_hz = "),
        ("cycle.rate_hz=", '--set: cycle.rate_hz = "": must be a number, not a string'),
        ("cycle.rate_hz=nan", "--set: cycle.rate_hz = nan: must be a finite number"),
        ("cycle.rate_hz=fast", '--set: cycle.rate_hz = "fast": must be a number, not a string'),
        ("cycle.rate_hz=1979-05-27", "--set: cycle.rate_hz = 1979-05-27: must be a number, not a date or time"),
        ("cycle.rate=1", "--set: cycle.rate: unknown key; did you mean rate_hz?"),
        ("percepton.clusters.threshold_m=1", "--set: percepton: unknown key; did you mean perception?"),
        ("clusters.threshold_m=1", "--set: clusters: unknown key; did you mean perception.clusters?"),
        ("log.level=verbos", '--set: log.level = "verbos": must be one of debug, info, warning, error'),
        ("ring.firing=octet", '--set: ring.firing.preset = "octet": must be one of single, opposite_pairs, thirds, '),
        ("ring.firing=7", "--set: ring.firing = 7: must be a table, not an integer"),
        ("ring.firing.sets=[[0]]", "--set over robots/denning.toml: ring.firing: give either preset or sets"),
        ("world.drum.0.radius=2", "--set: world.drum.0.radius: unknown key; did you mean radius_m?"),
        ("models.0.closed=1", "--set: models.0.closed = 1: must be true or false, not an integer"),
        ("ring.beam_half_angle_deg=120", "--set: ring.beam_half_angle_deg = 120: must be below 90 (and above 0)"),
    ],
)
def test_set_gone_wrong(text: str, wanted: str) -> None:
    line = problem(None, [text])
    assert line.startswith(wanted)
    assert len(line) < 250


def test_every_bad_set_is_told() -> None:
    assert len(problems(None, ["foo", "bar", "ring.count.x=1", "world=nowhere"])) == 4


def test_a_preset_over_sets_is_refused(tmp_path: Path) -> None:
    mine = write(tmp_path / "mine.toml", irregular(ROBOT))
    line = problem(mine, ["ring.firing.preset=single"])
    assert line == f"--set over {mine}: ring.firing: give either preset or sets, one of the two"


# --- where a value came from


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


def test_a_disagreement_names_all_who_have_a_part_in_it(tmp_path: Path) -> None:
    mine = write(tmp_path / "mine.toml", ROBOT)
    run = write(tmp_path / "run.toml", {"robot": "mine.toml", "ring": {"range_max_m": 5, "resolution_m": 0}})
    text = "ring: range_min_m 6.0 is not below range_max_m 5.0"
    assert problem(run, ["ring.range_min_m=6"]) == f"--set over {run}: {text}"
    assert problem(run, ["ring.range_min_m=6", "ring.range_max_m=5"]) == f"--set: {text}"
    text = "perception.segments: baseline_min_m 0.9 is not below baseline_max_m 0.5"
    assert problem(mine, ["perception.segments.baseline_min_m=0.9"]) == f"--set: {text}"


def test_a_disagreement_in_a_world_or_model_file(tmp_path: Path) -> None:
    model = copy.deepcopy(MODEL)
    model["vertices_m"][1] = model["vertices_m"][0]
    mine = write(tmp_path / "mine.toml", model)
    with pytest.raises(ConfigError) as caught:
        load_model(mine)
    assert str(caught.value) == f"{mine}: vertex 1 [0.0, 0.0] repeats vertex 0"
    assert problem(models=[str(mine)]) == f"{mine}: vertex 1 [0.0, 0.0] repeats vertex 0"


def test_a_section_no_robot_file_may_have(tmp_path: Path) -> None:
    mine = write(tmp_path / "mine.toml", {**ROBOT, "cycle": {"rate_hz": 5}})
    run = write(tmp_path / "run.toml", {"robot": "mine.toml"})
    assert problem(run) == f"{mine}: cycle: unknown key; known here: ring, body, link"


def test_too_many_problems_are_counted_not_listed(tmp_path: Path) -> None:
    run = write(tmp_path / "run.toml", "robot = 'denning'\n" + "".join(f"k{i} = 1\n" for i in range(5000)))
    lines = problems(run)
    assert len(lines) == 101
    assert lines[-1] == "… and 4900 problems more"


def test_entries_of_a_wrong_list_are_told_once() -> None:
    assert problem(None, ["models.0.vertices_m=[[0, 1], [2]]"]) == "--set: models.0.vertices_m.1.1: missing"
    assert problem(None, ["ring.firing={sets=[[0, -1]]}"]).startswith("--set: ring.firing.sets.0.1 = -1: must be")


def test_a_table_replaced_whole_forgets_where_its_old_values_came_from(tmp_path: Path) -> None:
    run = write(tmp_path / "run.toml", {"robot": "denning", "body": {"radius_m": 0.2}})
    lines = problems(run, ["body={radius_m=0, speed_max_m_s=1, turn_max_rad_s=-1}"])
    assert [line.split(" = ")[0] for line in lines] == ["--set: body.radius_m", "--set: body.turn_max_rad_s"]
