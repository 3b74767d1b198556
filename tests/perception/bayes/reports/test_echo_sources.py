"""Where in its beam an echo came from, against the true place of the drum or wall that answered."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest

from bench.trials.furnished_rooms import ACOUSTICS, furnished_room
from bench.trials.wall_trials import Segment, listen, true_corners
from config.load import load_settings
from config.world import WallConfig, WorldConfig
from drivers.messages import Firing
from perception.bayes.inference.kernel_settings import make_settings
from perception.bayes.memory.elements import Reading
from perception.bayes.reports.echo_sources import bearing_of
from perception.pipeline import Perception
from perception.records import zeros
from perception.sensor_mounts import mounts_array, ring_pose, sensor_pose
from tests.perception.halls import drive, drums

SETTINGS = load_settings("hallway")
MOUNTS = mounts_array(SETTINGS.ring.mounts)


def located(world: WorldConfig, *, last: int) -> list[tuple[float, float, float]]:
    """Return the contact x, y (m) and the range of each located echo of a drive's last firings."""
    return contacts_of(list(drive(world, (-4.0, 6.0))), last=last)


def contacts_of(firings: Sequence[Firing], *, last: int) -> list[tuple[float, float, float]]:
    """Return the same of these firings."""
    perception, found = Perception(SETTINGS.ring, SETTINGS.models, SETTINGS.perception), []
    bearings = np.full(24, math.nan)
    for k, firing in enumerate(firings):
        perception.observe(firing)
        while perception.can_refine:
            perception.refine()
        perception.method.locate_echoes(bearings)
        if k >= len(firings) - last:
            for i in np.flatnonzero(np.isfinite(firing.ranges_m) & np.isfinite(bearings)).tolist():
                r, (x, y, axis) = float(firing.ranges_m[i]), sensor_pose(MOUNTS, i, ring_pose(firing))
                assert abs(bearings[i]) <= math.radians(12.0) + 1e-9
                found.append((x + r * math.cos(axis + bearings[i]), y + r * math.sin(axis + bearings[i]), r))
    return found


@pytest.mark.compiled
def test_an_echo_of_a_recognised_drum_comes_from_its_near_side() -> None:
    world = drums((2.0, 5.0))
    drum = world.drum[0]
    contacts = located(world.model_copy(update={"wall": ()}), last=60)
    assert len(contacts) > 10
    for x, y, _ in contacts:
        assert math.hypot(x - drum.x_m, y - drum.y_m) == pytest.approx(drum.radius_m, abs=0.06)


@pytest.mark.compiled
def test_an_echo_of_a_sure_wall_comes_from_its_foot() -> None:
    wall = WallConfig(x1_m=-4.0, y1_m=1.5, x2_m=6.0, y2_m=1.5)
    contacts = located(WorldConfig(wall=(wall,)), last=60)
    assert len(contacts) > 30
    assert np.abs(np.array(contacts)[:, 1] - 1.5).max() < 0.06


@pytest.mark.compiled
def test_an_echo_of_a_corner_between_mirrors_comes_from_the_corner() -> None:
    room = furnished_room(5202, ACOUSTICS)
    walls = [Segment(np.array([w.x1_m, w.y1_m]), np.array([w.x2_m, w.y2_m])) for w in room.world.wall]
    corners = np.array([(it.x, it.y) for it in true_corners(walls) if not it.is_edge])
    contacts = np.array(contacts_of(listen(SETTINGS.ring, room, 5202, 0.15).firings, last=300))[:, :2]
    from_corner = np.hypot(*(contacts[:, None] - corners).transpose(2, 0, 1)).min(axis=1) < 0.05
    assert len(contacts) > 500
    assert from_corner.mean() > 0.5


def test_a_bearing_is_never_outside_the_beam() -> None:
    p = make_settings(SETTINGS.ring, SETTINGS.models, SETTINGS.perception.bayes)
    reading = zeros(Reading, 1).view(np.recarray)
    reading["axis_x"] = 1.0
    assert bearing_of(reading[0], 1.0, 0.1, p) == pytest.approx(math.atan2(0.1, 1.0))
    assert bearing_of(reading[0], 0.0, -1.0, p) == pytest.approx(-math.radians(12.0))
