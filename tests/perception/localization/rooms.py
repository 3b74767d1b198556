"""Rooms, stands and readings for the tests of localisation."""

from __future__ import annotations

import math

import numpy as np

from config.load import load_settings
from config.robot import RingConfig
from config.world import AcousticsConfig, PolygonConfig, WorldConfig
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.messages import Firing, Pose
from perception.kernel import Floats
from perception.localization.drumheller.panorama import Panorama, panoramas
from perception.localization.drumheller.pose_fit import beams_at
from perception.localization.room.expected_ranges import Beams
from perception.localization.room.room import Room, room_of

RING: RingConfig = load_settings("hallway").ring
HALF_ANGLE = math.radians(RING.beam_half_angle_deg)
EXACT = RING.model_copy(update={"resolution_m": 0.0})

RECTANGLE = ((0.0, 0.0), (5.0, 0.0), (5.0, 3.0), (0.0, 3.0))
CROOKED = ((0.0, 0.0), (5.0, 0.5), (4.5, 3.5), (2.0, 4.5), (-0.5, 3.0))


def world_of(corners: tuple[tuple[float, float], ...], acoustics: AcousticsConfig) -> WorldConfig:
    """A room with these corners."""
    return WorldConfig(polygon=(PolygonConfig(vertices_m=corners),), acoustics=acoustics)


def stand(world: WorldConfig, truth: Pose, seed: int = 0, ring: RingConfig = RING) -> tuple[Room, Firing]:
    """The room, and one firing of the whole ring at a pose that odometry calls the origin."""
    scene = compile_scene(world)
    ranges = Sonar(ring, scene, world.acoustics, np.random.default_rng(seed)).fire(truth, truth.theta)
    return room_of(world), Firing(0.0, Pose(0.0, 0.0, 0.0), 0.0, ranges)


def panorama_of(firing: Firing) -> Panorama:
    """The panorama of one firing."""
    (panorama,) = panoramas([firing], RING)
    return panorama


def beams_of(panorama: Panorama, *poses: Pose) -> Beams:
    """The sensors at these poses."""
    x, y, theta = np.array([(pose.x, pose.y, pose.theta) for pose in poses]).T
    return beams_at(panorama, x, y, theta)


def pose_row(pose: Pose) -> Floats:
    """A pose as an array, shape (1, 3)."""
    return np.array([[pose.x, pose.y, pose.theta]])
