"""Routes as missions, and as the files of missions."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from config.load import ConfigError, load_mission, parse_text
from config.mission import MissionConfig
from config.route import mission_text, route_config, waypoints_of

PLACES = ((1.0, -2.5, None), (0.25, 3.0, 90.0))


def test_a_route_comes_back_from_its_file() -> None:
    for frame in ("odom", "map"):
        text = mission_text(route_config(PLACES, frame, "corridor"), "A route.")
        mission = parse_text(MissionConfig, text, "file")
        assert (mission.name, waypoints_of(mission)) == ("corridor", (PLACES, frame))
        assert text.startswith("# A route.\n")


@pytest.mark.parametrize("name", ["patrol", "dock", "there-and-back", "stay-on-path"])
def test_a_mission_that_does_more_is_no_route(name: str) -> None:
    assert waypoints_of(load_mission(name)) is None


def test_waypoints_of_two_frames_are_no_route() -> None:
    steps = (*route_config(PLACES[:1], "map", "a").step, *route_config(PLACES[1:], "odom", "a").step)
    steps = tuple(step.model_copy(update={"name": name}) for step, name in zip(steps, "ab", strict=True))
    assert waypoints_of(MissionConfig(name="mixed", step=steps)) is None


def test_a_route_has_a_name_and_places_that_a_mission_can_have() -> None:
    with pytest.raises(ValidationError, match="name"):
        route_config(PLACES, "odom", "../up")
    with pytest.raises(ConfigError, match="x_m"):
        parse_text(MissionConfig, mission_text(route_config(PLACES, "odom", "a"), "").replace("1.0", '"east"'), "a")
