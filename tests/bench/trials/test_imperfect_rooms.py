"""Furnished, imperfect rooms: the same for the same seed, with all that real rooms have, and driven through."""

from __future__ import annotations

import functools
import math

import numpy as np
import pytest

from bench.trials.furnished_rooms import DRUM_RADIUS_M
from bench.trials.imperfect_rooms import BEND_M, CLEAR_M, MODELS, drive_through, imperfect_room
from bench.trials.shortest_way import CELL_M
from config.world import WorldConfig
from drivers.emulator.acoustics import clearance
from drivers.emulator.scene import compile_scene

SEEDS = range(4)
mixed_room = functools.cache(imperfect_room)


def surfaces_of(world: WorldConfig) -> set[str | None]:
    return {it.surface for kind in ("wall", "box", "drum") for it in getattr(world, kind)}


@pytest.mark.parametrize(("seeds", "each"), [(1, 3), pytest.param(len(SEEDS), 1, marks=pytest.mark.soak)])
def test_a_seed_is_one_room_whatever_it_is_heard_by(seeds: int, each: int) -> None:
    for seed in SEEDS[:seeds]:
        mixed = mixed_room(seed).world
        assert mixed == imperfect_room(seed).world
        for model in sorted(MODELS.keys() - {"mixture"})[::each]:
            world = imperfect_room(seed, model).world
            for kind in ("wall", "box", "drum"):
                bare = [
                    [it.model_copy(update={"surface": None}) for it in getattr(of, kind)] for of in (world, mixed)
                ]
                assert bare[0] == bare[1]
    assert mixed_room(0).world != mixed_room(1).world


def test_rooms_have_what_real_ones_have() -> None:
    surfaces: set[str | None] = set()
    walls, legs, boxes = [], [], 0
    for seed in SEEDS:
        world = mixed_room(seed).world
        assert sum(it.radius_m == DRUM_RADIUS_M for it in world.drum) == 3
        surfaces |= surfaces_of(world)
        walls += [it for it in world.wall if it.surface != "silent"]
        legs += [it.radius_m for it in world.drum if it.radius_m != DRUM_RADIUS_M]
        boxes += len(world.box)
    assert surfaces == {"cone", "specular", "rays", "silent"}
    assert all(BEND_M[0] <= abs(it.bend_m) <= BEND_M[1] or it.bend_m == 0.0 for it in walls)
    assert np.mean([it.bend_m != 0.0 for it in walls]) > 0.9
    assert len(legs) > 10 * len(SEEDS)
    assert max(legs) < 0.1
    assert boxes > 5 * len(SEEDS)


def test_a_room_may_have_no_drum() -> None:
    assert all(it.radius_m < 0.1 for it in imperfect_room(3, drums=0).world.drum)


def test_only_a_mixture_has_surfaces_of_its_own_and_only_jitter_jitters() -> None:
    for model in MODELS:
        world = imperfect_room(2, model).world
        own = surfaces_of(world) - {"silent", None}
        assert (own != set()) is model.startswith("mixture")
        assert (world.acoustics.jitter_m > 0.0) is ("jitter" in model)
        assert world.acoustics.late > 0.0


def test_drives_go_through_the_whole_room_and_touch_nothing() -> None:
    for seed in SEEDS:
        room = mixed_room(seed)
        scene, poses = compile_scene(room.world), drive_through(room, seed, 0.1, 30.0)
        assert poses.shape == (300, 3)
        assert np.hypot(*np.diff(poses[:, :2], axis=0).T).max() <= 0.1 + 1e-9
        least = min(clearance(x, y, scene.circles, scene.segments) for x, y in poses[:, :2].tolist())
        assert least > CLEAR_M - CELL_M  # between two free cells, and of bent walls whose line is planned with
        c, s = math.cos(room.turn_rad), math.sin(room.turn_rad)
        along = poses[:, :2] @ np.array([[c, -s], [s, c]])
        assert np.ptp(along[:, 0]) > 0.4 * room.width_m
        assert np.ptp(along[:, 1]) > 0.4 * room.depth_m
