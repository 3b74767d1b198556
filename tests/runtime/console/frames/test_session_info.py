"""The session message: robot, models, parameters, and the true world of an emulator."""

from __future__ import annotations

from tests.runtime.console.console_case import open_console


async def test_the_session_message_describes_robot_models_and_world() -> None:
    async with open_console() as case:
        page = await case.page()
        session = page.received[0]
        assert session["role"] == "control"
        assert session["name"] == "denning"
        assert session["emulated"] is True
        assert len(session["ring"]["mounts"]) == 24
        assert len(session["truth"]["drums"]) == 6
        assert session["models"][0]["name"] == "drum"
        assert session["period_s"] == 0.05
        assert session["radii"]["edge"] == 0.0 < session["radii"]["post"] < session["radii"]["barrel"]
        paths = {parameter["path"] for parameter in session["parameters"]}
        assert {"behaviors.avoid_static_obstacle.avoid_obstacle_gain", "cycle.perception_budget_s"} <= paths
        assert (await case.page()).received[0]["role"] == "watch"


async def test_the_known_room_is_sent_in_its_own_frame() -> None:
    drum = "[{x_m = 3.0, y_m = 1.0, radius_m = 0.3}]"
    async with open_console(f"perception.localization.known_room.drum={drum}") as case:
        page = await case.page()
        assert page.received[0]["known_room"] == {"drums": [[3.0, 1.0, 0.3]], "walls": [], "polygons": []}
    async with open_console() as case:
        assert (await case.page()).received[0]["known_room"] is None


async def test_a_real_robot_has_no_true_world() -> None:
    async with open_console(emulated=False) as case:
        assert (await case.page()).received[0]["truth"] is None
