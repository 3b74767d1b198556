"""The session message: robot, models, parameters, and the true world of an emulator."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.world import StartConfig, WallConfig, WorldConfig
from runtime.console.frames.session_info import shipped_missions, surfaces
from tests.installed import install
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


def test_a_bent_wall_is_sent_in_pieces() -> None:
    bent = WallConfig(x1_m=1.0, y1_m=0.0, x2_m=1.0, y2_m=3.0, bend_m=0.2)
    walls = surfaces(WorldConfig(wall=(bent,)), StartConfig())["walls"]
    assert walls == bent.pieces_m()
    assert len(walls) > 10


async def test_the_mission_of_a_package_that_is_wrong_is_left_out_and_pages_open(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    files = {"plug_missions/__init__.py": "", "plug_missions/wrong.toml": 'name = "wrong"\nstep = 3\n'}
    install(monkeypatch, tmp_path / "site", files, {"echolocate.missions": {"mine": "plug_missions"}})
    shipped_missions.cache_clear()
    try:
        async with open_console() as case:
            page = await case.page()
            named = [mission["name"] for mission in page.received[0]["missions"]]
            assert "patrol" in named
            assert "wrong" not in named
            answer = await page.ask(type="start_mission", name="wrong")
            assert "step = 3: must be a list" in answer["error"]
    finally:
        shipped_missions.cache_clear()


async def test_a_real_robot_has_no_true_world() -> None:
    async with open_console(emulated=False) as case:
        assert (await case.page()).received[0]["truth"] is None
