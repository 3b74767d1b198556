"""The shipped files: all of them load, and their values are those of the paper."""

from __future__ import annotations

import itertools
import math
import tomllib
from pathlib import Path

import pytest

import config.load
from config.load import list_shipped, load_any, load_mission, load_model, load_robot, load_settings, load_world
from config.robot import SOUND_SPEED_M_S

FT = 0.3048
TABLE_2 = {(1.0, 4.0), (4.0, 4.0), (7.0, 4.0), (1.0, -4.0), (4.0, -4.0), (7.0, -4.0)}


def test_the_names_of_shipped_files() -> None:
    assert list_shipped("robots") == (
        "amigo",
        "atrvjr",
        "b21r",
        "b21r-base",
        "b21r-both",
        "denning",
        "ears",
        "hobby3",
        "hobby8",
        "magellan",
        "p3at",
        "p3dx",
        "p3dx-sh",
        "parking12",
        "peoplebot",
        "powerbot",
        "servo1",
    )
    assert list_shipped("worlds") == ("hallway", "irregular", "office", "room")
    assert list_shipped("models") == ("box", "drum", "semicircle")
    assert list_shipped("runs") == ("hallway", "irregular", "office", "room")
    assert len(list_shipped("missions")) == 10
    assert list_shipped("studies") == ("halls",)


def test_every_shipped_file_loads() -> None:
    for name in list_shipped("robots"):
        load_robot(name)
    for name in list_shipped("worlds"):
        load_world(name)
    for name in list_shipped("models"):
        assert load_model(name).name == {"semicircle": "drum"}.get(name, name)
    for name in list_shipped("missions"):
        assert load_mission(name).name == name
    for name in list_shipped("runs"):
        assert load_any(name) == load_settings(name)


def test_every_shipped_file_is_packaged_and_explains_itself() -> None:
    root = Path(config.load.__file__).parent
    packaged = tomllib.loads((root.parent / "pyproject.toml").read_text("utf-8"))["tool"]["setuptools"][
        "package-data"
    ]
    shipped = {path for pattern in packaged["config"] for path in root.glob(pattern)}
    assert shipped == set(root.rglob("*.toml"))
    for path in shipped:
        assert path.read_text("utf-8").startswith("# "), path


def test_the_denning_ring() -> None:
    robot = load_robot("denning")
    assert len(robot.ring.mounts) == 24
    assert math.hypot(*robot.ring.mounts[5][:2]) == pytest.approx(1.25 * FT)
    assert robot.ring.mounts[6].angle_rad == pytest.approx(math.pi / 2)
    assert robot.ring.range_min_m == pytest.approx(0.5 * FT)
    assert robot.ring.range_max_m == pytest.approx(25.5 * FT)
    assert robot.ring.resolution_m == pytest.approx(0.1 * FT)
    assert robot.ring.firing.preset == "octets"
    assert robot.ring.firing.step_period_s >= 2.0 * robot.ring.window_m / SOUND_SPEED_M_S
    assert robot.body.synchro


def test_the_hallway_is_the_papers_table_2() -> None:
    world = load_world("hallway")
    assert {(round(d.x_m / FT, 6), round(d.y_m / FT, 6)) for d in world.drum} == TABLE_2
    assert {d.radius_m for d in world.drum} == {FT}
    assert world.start.x_m == pytest.approx(-6 * FT)
    assert world.start.y_m == world.start.heading_deg == 0.0
    sound = world.acoustics
    assert sound.model == "cone"
    assert sound.noise_m == sound.noise_relative == sound.dropout == sound.outliers == sound.crosstalk == 0.0


def test_the_irregular_hallway_is_irregular_and_passable() -> None:
    world, robot = load_world("irregular"), load_robot("denning")
    assert len(world.drum) == 8
    assert world.acoustics.noise_relative == 0.01
    for side in (1, -1):
        column = sorted((d.x_m, abs(d.y_m)) for d in world.drum if d.y_m * side > 0)
        assert len(column) == 4
        assert len({y for _, y in column}) == 4
        steps = [b[0] - a[0] for a, b in itertools.pairwise(column)]
        assert len({round(s, 3) for s in steps}) == 3
        assert all(3.0 * FT <= s <= 4.0 * FT for s in steps)
        assert all(3.4 * FT <= y <= 4.6 * FT for _, y in column)
    room = min(abs(d.y_m) - d.radius_m for d in world.drum)
    assert room > 1.5 * robot.body.radius_m


@pytest.mark.parametrize("name", ["hallway", "irregular"])
def test_the_runs_pass_the_last_drum_and_come_back(name: str) -> None:
    run = load_settings(name)
    assert run.world == load_world(name)
    assert run.models == (load_model("semicircle"),)
    assert run.ring == load_robot("denning").ring
    move = run.behaviors.move_ahead
    assert move.at_end == "turn_back"
    assert move.distance_m is not None
    assert run.world is not None
    assert run.world.start.x_m + move.distance_m > max(d.x_m + d.radius_m for d in run.world.drum)


@pytest.mark.parametrize(("name", "sides"), [("semicircle", 5), ("drum", 16)])
def test_the_round_models_have_equal_chords_on_the_true_circle(name: str, sides: int) -> None:
    model = load_model(name)
    assert model.arc_radius_m == FT
    assert model.closed == (name == "drum")
    ring = model.vertices_m + (model.vertices_m[:1] if model.closed else ())
    chords = [math.dist(a, b) for a, b in itertools.pairwise(ring)]
    assert len(chords) == sides
    assert max(chords) == pytest.approx(min(chords), abs=2e-6)
    assert all(math.hypot(*v) == pytest.approx(FT, abs=1e-6) for v in model.vertices_m)


def test_the_semicircle_opens_backwards() -> None:
    model = load_model("semicircle")
    assert model.vertices_m[0] == pytest.approx((0.0, -FT))
    assert model.vertices_m[-1] == pytest.approx((0.0, FT))
    assert all(x > 0 for x, _ in model.vertices_m[1:-1])


def test_the_box_is_two_feet_square() -> None:
    model = load_model("box")
    assert model.closed
    assert model.arc_radius_m is None
    assert {(abs(x), abs(y)) for x, y in model.vertices_m} == {(FT, FT)}
    assert len(set(model.vertices_m)) == 4


def test_the_default_run_is_the_papers_experiment() -> None:
    assert load_settings() == load_settings("hallway")
