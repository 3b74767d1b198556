"""A schema of an installed package is validated, kept, and driven as a shipped one is."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.files import ConfigError
from config.load import parse_text
from config.mission import MissionConfig
from config.plugins import SCHEMAS
from config.reference import settings_of
from config.schema_use import SHIPPED_USES
from tests.behaviors.mission_robot import driven
from tests.installed import install

ORBIT = '''
"""A schema of its own."""
import math
from typing import ClassVar, Literal

from behaviors.response import Response
from behaviors.schema_call import Answer, Memory, Scene
from config.mission_step import Use
from pydantic import Field


class OrbitUse(Use):
    """`orbit`: to a distance from where the step begins; arrives there."""

    can_arrive: ClassVar[bool] = True
    name: Literal["orbit"]
    """Of the schema."""
    out_m: float = Field(default=1.0, gt=0.0, le=10.0)
    """That distance, m."""

    def answer(self, scene: Scene, memory: Memory) -> Answer:
        pose, start = scene.percept.pose, scene.start
        rest_m = max(0.0, self.out_m - math.hypot(pose.x - start.x, pose.y - start.y))
        return Answer(Response("orbit", float(rest_m > 0.0), 0.0), memory, has_arrived=rest_m == 0.0)
'''
MISSION = 'name = "there"\n[[step]]\nname = "out"\n[[step.schemas]]\nname = "{}"\n{}\n'


@pytest.fixture(autouse=True)
def _package(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    install(monkeypatch, tmp_path / "site", {"plug_orbit.py": ORBIT}, {SCHEMAS: {"orbit": "plug_orbit:OrbitUse"}})


def test_it_is_part_of_a_mission_and_written_with_it() -> None:
    mission = parse_text(MissionConfig, MISSION.format("orbit", "out_m = 2.0"), "m")
    assert mission.model_dump()["step"][0]["schemas"] == ({"name": "orbit", "out_m": 2.0},)
    for again in (
        MissionConfig.model_validate(mission.model_dump(mode="json")),
        MissionConfig.model_validate_json(mission.model_dump_json()),
    ):
        assert again == mission
    assert mission.step[0].arrives


def test_it_drives_and_arrives() -> None:
    robot = driven({"schemas": [{"name": "orbit", "out_m": 0.5}]}, seconds=20.0)
    assert robot.status == "done"
    assert 0.45 < robot.pose.x < 0.8


@pytest.mark.parametrize(
    ("name", "line", "said"),
    [
        ("orbit", "out_m = 20.0", "m: step.0.schemas.0.out_m = 20.0: must be at most 10"),
        ("orbit", "uot_m = 2.0", "m: step.0.schemas.0.uot_m: unknown key; did you mean out_m?"),
        ("orbital", "", 'm: step.0.schemas.0.name = "orbital": must be one of'),
        ("orbital", "", "swirl, orbit; did you mean orbit?"),
        ("wander", "", "the step out never ends"),
    ],
)
def test_what_is_wrong_is_named_with_its_place(name: str, line: str, said: str) -> None:
    with pytest.raises(ConfigError) as caught:
        parse_text(MissionConfig, MISSION.format(name, line), "m")
    assert said in str(caught.value)


def test_the_reference_lists_it_and_the_one_list_says_which_lead() -> None:
    assert "step[].schemas[orbit].out_m" in [one.path for one in settings_of("mission")]
    helpers = tuple(name for name, use in SHIPPED_USES.items() if not use.leads)
    assert helpers == ("follow_valley", "leave_canyon", "avoid_past", "noise", "swirl")
    assert {name for name, use in SHIPPED_USES.items() if use.can_arrive} == {
        "move_to_goal", "turn", "stay_on_path", "approach_object", "search",
    }  # fmt: skip
