"""False canyons: how they are counted, that corridors have a way out, and that none is reported on a drive in one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np
import pytest

from bench.trials.false_canyon_trials import DOORWAY_M, ENDS, FalseCanyonTrial, corridor, try_path
from bench.trials.false_wall_trials import drum_hall
from config.load import load_settings
from config.world import WallConfig, WorldConfig
from drivers.emulator.acoustics import clearance
from drivers.emulator.scene import compile_scene
from perception.percept import Canyon
from runtime.simulation.random_halls import ACOUSTICS

SETTINGS = load_settings("hallway", ["perception.method=bayes"])
ROUGH = ACOUSTICS.model_copy(update={"model": "cone"})


def canyon(number: int, probability: float) -> Canyon:
    return Canyon(number, (0.0, 1.0, 0.0, -1.0), 0.0, 3.0, probability)


def test_each_canyon_counts_once_with_its_highest_probability() -> None:
    trial = FalseCanyonTrial()
    for seen in ((canyon(1, 0.6),), (canyon(1, 0.95), canyon(2, 0.7)), (canyon(2, 0.5),), ()):
        trial.add(seen)
    assert (len(trial.reported), trial.above(0.9), trial.above(0.65), trial.at_end) == (2, 1, 2, 0)


def test_corridors_are_wide_enough_and_their_doorways_lead_out() -> None:
    """From every place of the path, the robot with its clearance reaches the world outside the walls."""
    robot_m = 0.5 * DOORWAY_M[0] - 0.08
    for seed in range(len(ENDS)):
        world, path = corridor(seed, ROUGH)
        scene = compile_scene(world)
        free = [clearance(x, y, scene.circles, scene.segments) for x, y in path[:, :2].tolist()]
        assert min(free) > SETTINGS.body.radius_m + 0.05
        assert reaches_outside(world, path[len(path) // 2, :2].tolist(), robot_m), ENDS[seed]


def reaches_outside(world: WorldConfig, place: list[float], robot_m: float) -> bool:
    """Return whether a disc gets out of the corridor without its start, by a flood over cells of 10 cm."""
    cell, low, shape = 0.1, np.array([-0.5, -8.0]), (190, 160)
    x, y = (low[k] + cell * (0.5 + np.arange(shape[k])) for k in range(2))
    free = np.ones(shape, bool)
    start_wall = WallConfig(x1_m=0.0, y1_m=-8.0, x2_m=0.0, y2_m=8.0)  # the way in does not count
    for wall in (*world.wall, start_wall):
        along = (wall.x2_m - wall.x1_m, wall.y2_m - wall.y1_m)
        px, py = x[:, None] - wall.x1_m, y[None, :] - wall.y1_m
        share = np.clip((px * along[0] + py * along[1]) / (along[0] ** 2 + along[1] ** 2), 0.0, 1.0)
        free &= np.hypot(px - share * along[0], py - share * along[1]) > robot_m
    reached = np.zeros(shape, bool)
    reached[tuple(((np.array(place) - low) / cell).astype(int))] = True
    while not (reached[-1].any() or reached[:, 0].any() or reached[:, -1].any()):
        grown = np.pad(reached, 1)
        grown = (grown[1:-1, 1:-1] | grown[2:, 1:-1] | grown[:-2, 1:-1] | grown[1:-1, 2:] | grown[1:-1, :-2]) & free
        if (grown == reached).all():
            return False
        reached = grown
    return True


@pytest.mark.compiled
@pytest.mark.promise("P33")
def test_no_canyon_in_a_corridor_with_doorways_and_one_where_its_end_is_closed(
    measured: Callable[[str], None],
) -> None:
    world, path = corridor(1, ROUGH)
    open_end = try_path(SETTINGS, world, path[: len(path) // 2], 1)
    assert open_end.reported == {}
    dead_end = WorldConfig(
        wall=tuple(
            WallConfig(x1_m=a, y1_m=b, x2_m=c, y2_m=d)
            for a, b, c, d in ((0.0, 1.0, 5.0, 1.0), (5.0, 1.0, 5.0, -1.0), (5.0, -1.0, 0.0, -1.0))
        ),
        acoustics=ROUGH,
    )
    x = np.array([0.3, 4.1, 2.5])
    way = np.column_stack([x, np.zeros(3), np.zeros(3)])
    closed = try_path(SETTINGS, dead_end, way, 1)
    assert closed.above(SETTINGS.behaviors.leave_canyon.probability_min) == 1
    measured(f"{open_end.driven_m:.0f} m of corridor: no canyon; a dead end: one")


@pytest.mark.soak
@pytest.mark.compiled
@pytest.mark.promise("P33")
@pytest.mark.parametrize("model", ["cone", "specular"])
def test_no_canyon_in_many_corridors_and_halls(
    model: Literal["cone", "specular"], measured: Callable[[str], None]
) -> None:
    acoustics = ACOUSTICS.model_copy(update={"model": model})
    for seed in range(2000, 2020):
        for world, path in (corridor(seed, acoustics), drum_hall(seed, acoustics)):
            assert try_path(SETTINGS, world, path, seed).reported == {}, seed
    measured(f"{model}: no canyon in 20 corridors and 20 halls")
