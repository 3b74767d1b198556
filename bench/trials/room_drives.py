"""Drives of any robot through the shipped worlds, and through rooms and corridors that are generated."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from bench.sparse_rings import RINGS, with_ring
from bench.trials.furnished_rooms import ACOUSTICS, furnished_room
from config.load import load_settings
from config.settings import Settings
from config.world import StartConfig, WallConfig, WorldConfig
from drivers.emulator.acoustics import clearance
from drivers.emulator.scene import compile_scene
from drivers.messages import Pose

CORRIDOR_M: Final = (0.7, 1.6)
"""Free width of a corridor beside the robot, m."""
CORRIDOR_LENGTH_M: Final = 9.0
TILT_RAD: Final = math.radians(8.0)
"""Greatest angle between a corridor and the robot's first heading."""


class Drive(NamedTuple):
    """What is driven where."""

    settings: Settings
    world: WorldConfig


def make_drive(robot: str, room: str, seed: int) -> Drive:
    """Return a drive: shipped runs and missions in the shipped worlds, or a generated world.

    Parameters
    ----------
    robot
        A shipped robot file, or one of `RINGS`.
    room
        `room`, `office`, `hallway`, `furnished`, `goal` or `corridor`.
    seed
        Of a generated world, and of a mission's schemas.
    """
    if room in {"office", "hallway"}:
        settings = drive_settings(room, robot)
        assert settings.world is not None
        return Drive(settings, settings.world)
    if room == "corridor":
        settings = drive_settings("room", robot, "behaviors.move_ahead.distance_m=30.0")
        return Drive(settings, _corridor(settings.body.radius_m, seed))
    if room == "goal":
        world = _furnished(seed, drive_settings("room", robot).body.radius_m)
        goal = _goal(seed, world)
        return Drive(drive_settings("office", robot, f"goal={{x_m={goal.x:.2f}, y_m={goal.y:.2f}}}"), world)
    settings = drive_settings("room", robot, mission="wander")
    assert settings.world is not None
    return Drive(settings, settings.world if room == "room" else _furnished(seed, settings.body.radius_m))


def drive_settings(run: str, robot: str, *sets: str, mission: str | None = None) -> Settings:
    """Return the settings of a shipped run with a shipped robot, or with one of `RINGS`."""
    if robot in RINGS:
        return with_ring(load_settings(run, sets, robot="denning", mission=mission), robot)
    return load_settings(run, sets, robot=robot, mission=mission)


def _furnished(seed: int, radius_m: float) -> WorldConfig:
    """Return a furnished room with a start that is clear of everything."""
    room, rng = furnished_room(seed), np.random.default_rng([seed, 38])
    scene = compile_scene(room.world)
    x = y = 0.0
    for _ in range(200):
        x, y = room.place(*rng.uniform(-0.4, 0.4, 2).tolist())
        if clearance(x, y, scene.circles, scene.segments) > radius_m + 0.25:
            break
    start = StartConfig(x_m=x, y_m=y, heading_deg=float(rng.uniform(-180.0, 180.0)))
    return room.world.model_copy(update={"start": start})


def _goal(seed: int, world: WorldConfig) -> Pose:
    """Return a place in the room, in odometry's frame."""
    room, rng = furnished_room(seed), np.random.default_rng([seed, 39])
    start = Pose(world.start.x_m, world.start.y_m, math.radians(world.start.heading_deg))
    there = max((room.place(*rng.uniform(-0.35, 0.35, 2).tolist()) for _ in range(4)),
                key=lambda place: math.dist(place, (start.x, start.y)))  # fmt: skip
    return start.inverse().compose(Pose(*there, 0.0))


def _corridor(radius_m: float, seed: int) -> WorldConfig:
    rng = np.random.default_rng([seed, 40])
    half, length = radius_m + 0.5 * float(rng.uniform(*CORRIDOR_M)), CORRIDOR_LENGTH_M
    corners = [(-1.5, -half), (length, -half), (length, half), (-1.5, half)]
    walls = tuple(
        WallConfig(x1_m=a[0], y1_m=a[1], x2_m=b[0], y2_m=b[1])
        for a, b in zip(corners, [*corners[1:], corners[0]], strict=True)
    )
    tilt_deg = math.degrees(float(rng.uniform(-TILT_RAD, TILT_RAD)))
    return WorldConfig(wall=walls, acoustics=ACOUSTICS, start=StartConfig(x_m=0.0, y_m=0.0, heading_deg=tilt_deg))
