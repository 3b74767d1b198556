"""The mission file: what is wrong with it as a state machine is said in a line, with the step and the remedy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from config.errors import DONE, WRONG_CALL
from config.load import (
    ConfigError,
    list_shipped,
    load_any,
    load_mission,
    load_settings,
    override_settings,
    with_mission,
)
from config.mission import MissionConfig
from runtime.cli.app import run_command
from tests.config.toml_text import MISSION, document

WANDER = [{"name": "wander"}]
GOAL = [{"name": "move_to_goal", "x_m": 1.0, "y_m": 0.0}]
HOME = {"name": "home", "schemas": GOAL}
A_SECOND = [{"when": "time", "after_s": 1.0}]


def steps(*tables: dict[str, Any], **also: object) -> dict[str, Any]:
    return {"name": "test", "step": list(tables), **also}


def refused(table: dict[str, Any], folder: Path) -> str:
    (folder / "m.toml").write_text(document(table), encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        load_mission(folder / "m.toml")
    return str(caught.value).removeprefix(f"{folder / 'm.toml'}: ")


WRONG = {
    "a target that does not exist": (
        steps({"name": "out", "schemas": GOAL, "until": [{"when": "reached", "go": "hme"}]}, HOME),
        "the step out goes to hme on reached: there is no such step; did you mean home?",
    ),
    "unreachable": (
        steps({"name": "out", "schemas": GOAL, "until": [{"when": "reached", "go": "done"}]}, HOME),
        "the step home is never reached: let a condition of another step go to it, or leave it out",
    ),
    "no end": (
        steps({"name": "out", "schemas": GOAL, "until": [{"when": "reached", "go": "out"}]}),
        "from the step out the mission never ends: let a condition go to done or failed, or set endless = true",
    ),
    "an end that some steps cannot reach": (
        steps(
            {
                "name": "a",
                "schemas": GOAL,
                "until": [{"when": "reached", "go": "done"}, {"when": "stuck", "go": "b"}],
            },
            {"name": "b", "schemas": WANDER, "until": [{"when": "time", "after_s": 1.0, "go": "b"}]},
        ),
        "from the step b the mission never ends: let a condition go to done or failed, or set endless = true",
    ),
    "the same name twice": (
        steps({"name": "a", "schemas": GOAL}, {"name": "a", "schemas": GOAL}),
        "two steps are named a: give each a name of its own",
    ),
    "a step named as an end": (
        steps({"name": "done", "schemas": GOAL}),
        "a step cannot be named done, which is what conditions name: choose another name",
    ),
    "a step that never ends": (
        steps({"name": "a", "schemas": WANDER}),
        "step.0: the step a never ends: give it `until`, for example a time",
    ),
    "nothing that arrives": (
        steps({"name": "a", "schemas": WANDER, "until": [{"when": "reached"}]}),
        "step.0: until: nothing in the step a can be reached: give a time or a way instead",
    ),
    "two that arrive": (
        steps({"name": "a", "schemas": [*GOAL, {"name": "search"}]}),
        "step.0: two of the schemas can arrive, so `reached` has two meanings: make two steps of them",
    ),
    "a turn beside another schema": (
        steps({"name": "a", "schemas": [{"name": "turn", "heading_deg": 1.0}, *WANDER]}),
        "step.0: the schema turn stands alone in its step, as the robot turns on the spot",
    ),
    "an unknown schema": (
        steps({"name": "a", "schemas": [{"name": "wandr"}]}),
        'step.0.schemas.0.name = "wandr": must be one of move_ahead, move_to_goal, turn, wander, follow_wall, '
        "stay_on_path, approach_object, search, follow_valley, leave_canyon, avoid_past, noise, swirl; did you mean "
        "wander?",
    ),
    "a schema without a name": (
        steps({"name": "a", "schemas": [{"x_m": 1.0}]}),
        "step.0.schemas.0.name: missing; must be one of move_ahead, move_to_goal, turn, wander, follow_wall, "
        "stay_on_path, approach_object, search, follow_valley, leave_canyon, avoid_past, noise, swirl",
    ),
    "an unknown condition": (
        steps({"name": "a", "schemas": GOAL, "until": [{"when": "reach"}]}),
        'step.0.until.0.when = "reach": must be one of reached, seen, unseen, time, way, bumper, lost, stuck, '
        "unreachable; did you mean reached?",
    ),
    "a schema that turns the others', without others": (
        steps({"name": "a", "schemas": [{"name": "swirl"}, {"name": "noise"}], "until": A_SECOND}),
        "step.0: swirl needs a way: add a schema that leads somewhere, for example move_ahead",
    ),
    "a canyon without a goal": (
        steps({"name": "a", "schemas": [*WANDER, {"name": "leave_canyon"}], "until": A_SECOND}),
        "step.0: leave_canyon goes round what closes the way to a goal: add move_to_goal",
    ),
    "a gain given twice": (
        steps({"name": "a", "schemas": [*GOAL, {"name": "noise"}, {"name": "noise", "gain": 0.5}]}),
        "step.0: the schema noise stands twice: leave one of them out",
    ),
    "nothing that could be unreachable": (
        steps({"name": "a", "schemas": WANDER, "until": [{"when": "unreachable"}]}),
        "step.0: until: the step a has no goal that could be unreachable: use stuck",
    ),
    "a key of another schema": (
        steps({"name": "a", "schemas": [{"name": "wander", "x_m": 1.0}], "until": A_SECOND}),
        "step.0.schemas.0.x_m: unknown key; known here: name, gain, seed, persistence_s, free_m",
    ),
    "a path of one place": (
        steps({"name": "a", "schemas": [{"name": "stay_on_path", "points_m": [[1.0, 1.0], [1.0, 1.0]]}]}),
        "step.0.schemas.0: points_m 0 and 1 are the same place: leave one of them out",
    ),
    "no steps": (steps(), "step = []: needs at least one entry, has 0"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_said_in_a_line(name: str, tmp_path: Path) -> None:
    table, expected = WRONG[name]
    assert refused(table, tmp_path) == expected


def test_check_knows_a_mission_file_and_its_errors(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "errand.toml"
    path.write_text(document(MISSION), encoding="utf-8")
    assert run_command(["check", str(path)]) == DONE
    assert capsys.readouterr().out == f"{path}: good\n"
    assert isinstance(load_any(path), MissionConfig)
    path.write_text(document(steps({"name": "a", "schemas": WANDER})), encoding="utf-8")
    assert run_command(["check", str(path)]) == WRONG_CALL
    assert "the step a never ends" in capsys.readouterr().err


def test_a_run_names_its_mission_and_must_recognise_what_it_looks_for(tmp_path: Path) -> None:
    (tmp_path / "errand.toml").write_text(document(MISSION), encoding="utf-8")
    (tmp_path / "run.toml").write_text('robot = "denning"\nmission = "./errand.toml"\n', encoding="utf-8")
    mission = load_settings(tmp_path / "run.toml").mission
    assert mission == MissionConfig.model_validate(MISSION)
    assert load_settings("room", mission="dock").mission == load_mission("dock")
    assert load_settings("room", ["mission=dock"]).mission == load_mission("dock")
    with pytest.raises(ConfigError, match=r'mission "dok": no such mission; did you mean dock\?'):
        load_settings("room", ["mission=dok"])
    with pytest.raises(ConfigError, match="mission dock looks for drum, which no model is named"):
        load_settings("hallway", mission="dock", models=["box"])
    with pytest.raises(ConfigError, match="goal and mission exclude each other"):
        load_settings("room", ["goal.x_m=1.0", "goal.y_m=0.0"], mission="dock")
    with pytest.raises(ConfigError, match="mission dock looks for drum"):
        with_mission(load_settings("hallway", models=["box"]), load_mission("dock"))
    assert with_mission(load_settings("room"), load_mission("dock")).mission == load_mission("dock")
    recorded = load_settings("room", mission="inspect-drums")
    assert override_settings(recorded, "a recording", []) == recorded


def test_where_conditions_lead() -> None:
    mission = MissionConfig.model_validate(MISSION)
    assert [mission.index(target, 0) for target in ("next", "dock", "done", "hold")] == [1, 3, None, None]
    assert mission.index("next", len(mission.step) - 1) is None
    assert mission.objects() == {"wall"}
    assert mission.needs_map, "it waits for being lost in the map"
    assert not load_mission("patrol").needs_map
    assert [c.when for c in mission.step[1].conditions] == ["reached"], "the default"


def test_a_frame_of_any_schema_makes_it_a_mission_for_the_map() -> None:
    for use in (
        {"name": "move_to_goal", "x_m": 0.0, "y_m": 0.0, "frame": "map"},
        {"name": "turn", "heading_deg": 0.0, "relative_to": "map"},
        {"name": "stay_on_path", "points_m": [[0.0, 0.0], [1.0, 0.0]], "frame": "map"},
    ):
        assert MissionConfig.model_validate(steps({"name": "a", "schemas": [use]})).needs_map
    assert all(not load_mission(name).needs_map for name in list_shipped("missions"))
