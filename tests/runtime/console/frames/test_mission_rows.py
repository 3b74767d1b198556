"""A mission as frames have it: its state machine as the file has it, its places, and how far it has come."""

from __future__ import annotations

from typing import Any

import orjson

from behaviors.missions.mission import Mission, goes_to
from config.load import list_shipped, load_mission
from runtime.console.frames.mission_rows import MissionRows


def shown(rows: MissionRows, mission: Mission) -> dict[str, Any]:
    row: dict[str, Any] = orjson.loads(orjson.dumps(rows.row(mission)))
    return row


def test_the_steps_with_their_conditions_and_places() -> None:
    row = shown(MissionRows(), Mission(load_mission("there-and-back")))
    assert (row["kind"], row["name"], row["status"], row["step"], row["reason"]) == (
        "mission", "there-and-back", "running", 0, None,
    )  # fmt: skip
    there, wait, _back = row["steps"]
    assert there["schemas"] == ["move_to_goal"]
    assert there["places"] == [[1.5, 0.0, 90.0]]
    assert there["until"] == [["reached", "next"], ["stuck", "back"]]
    assert (wait["schemas"], wait["until"]) == ([], [["time 3 s", "next"]])


def test_what_changes_is_that_of_now_and_a_new_plan_is_encoded_anew() -> None:
    rows, mission = MissionRows(), Mission(load_mission("dock"))
    assert shown(rows, mission)["steps"][0]["until"][0] == ["seen drum", "dock"]
    ended = goes_to(mission, "failed", "reached in its step search")
    assert shown(rows, ended)["reason"] == "the mission dock has failed: reached in its step search"
    assert shown(rows, Mission(load_mission("stay-on-path")))["steps"][0]["places"][1] == [1.3, 0.0, None]
    for name in list_shipped("missions"):
        assert len(shown(rows, Mission(load_mission(name)))["steps"]) == len(load_mission(name).step)
