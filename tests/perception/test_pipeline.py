"""Perception as a whole: the method that the settings name, the check of a firing's size, and a reset."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.load import load_model, load_world, with_known_room
from drivers.messages import Firing, Pose
from perception.detected_object import DetectedObject
from perception.edits import PlaceRobot
from perception.pipeline import Perception
from perception.snapshot import bounds_of
from runtime.recording.snapshot_bounds import check_snapshot
from tests.perception.edited import settle
from tests.perception.halls import drive, settings


@pytest.mark.parametrize("count", [0, 23, 25])
def test_a_firing_of_another_ring_is_refused(count: int) -> None:
    """Kernels do not check the bounds of an array, so a wrong size must not reach them."""
    chosen = settings()
    perception = Perception(chosen.ring, chosen.models, chosen.perception)
    with pytest.raises(ValueError, match=f"a firing of {count} ranges, but the ring has 24 sensors"):
        perception.observe(Firing(0.0, Pose(0.0, 0.0, 0.0), 0.0, np.full(count, 2.0)))


def test_a_recognised_object_is_an_obstacle_where_no_echo_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    chosen, here = settings(), Pose(0.0, 0.0, 0.0)
    perception = Perception(chosen.ring, chosen.models, chosen.perception)
    assert len(perception.surroundings(0.0, 0.0, here, 1.0)[1]) == 0
    drum = DetectedObject("drum", 1.0, 0.0, 0.0, 0.003, 40, 0.999, 0.999)
    monkeypatch.setattr(Perception, "near_objects", lambda _: (drum,))
    foot = [[1.0 - load_model("drum").reach_m, 0.0]]
    np.testing.assert_allclose(perception.surroundings(0.0, 0.0, here, 1.0)[1], foot, atol=1e-9)
    np.testing.assert_allclose(perception.steady_obstacles(0.0, 1.0, here), foot, atol=1e-9)


@pytest.mark.compiled
def test_in_a_known_room_the_place_is_found_and_a_snapshot_continues_to_the_bit() -> None:
    chosen = with_known_room(settings(), "irregular")
    perception, other = (Perception(chosen.ring, chosen.models, chosen.perception) for _ in range(2))
    for k, firing in enumerate(drive(load_world("irregular"), (-5.0, 4.0))):
        for one in (perception,) if k <= 55 else (perception, other):
            one.observe(firing)
            quanta = 0
            while one.can_refine and quanta < 50 + k % 7:
                quanta += one.refine() > 0
        if k == 55:
            assert perception.known_room is not None
            assert perception.known_room.can_refine, "in the midst of the search"
            other.restore(perception.snapshot())
    here, at = perception.localized(), other.localized()
    assert here is not None
    assert repr(here) == repr(at)
    assert here.status == "tracking"
    assert (firing.pose.x, firing.pose.y) == pytest.approx((here.pose.x, here.pose.y), abs=0.1)
    assert perception.odometry_from_map().x == pytest.approx(0.0, abs=0.1)
    assert perception.objects() == perception.mapped_objects(), "what the method holds is in odometry's frame"
    perception.reset()
    again = perception.localized()
    assert again is not None
    assert again.status == "localizing"


@pytest.mark.compiled
def test_another_window_is_heard_as_from_the_start_and_what_is_known_stays() -> None:
    chosen = with_known_room(settings(), "irregular")
    firing = chosen.ring.firing.model_copy(update={"window_m": 4.0})
    ring = chosen.ring.model_copy(update={"firing": firing})
    changed, fresh = (Perception(one, chosen.models, chosen.perception) for one in (chosen.ring, ring))
    assert changed.edit(PlaceRobot(1.0, 2.0, 0.5)) is None
    before = changed.localized()
    changed.set_firing_pattern(ring)
    check_snapshot(changed.snapshot(), fresh.snapshot(), bounds_of(fresh))
    assert changed.known_room is not None
    assert changed.known_room._grid._window_m == 4.0
    assert repr(changed.localized()) == repr(before)


def test_the_robot_is_placed_in_a_known_room_only() -> None:
    chosen = settings()
    perception = Perception(chosen.ring, chosen.models, chosen.perception)
    assert perception.edit(PlaceRobot(1.0, 2.0, 0.5)) == "there is no known room: start with --map, or load a map"
    chosen = with_known_room(chosen, "irregular")
    perception = Perception(chosen.ring, chosen.models, chosen.perception)
    assert "invalid pose" in (perception.edit(PlaceRobot(1.0, math.nan, 0.5)) or "")
    assert perception.edit(PlaceRobot(1.0, 2.0, 0.5)) is None
    here = perception.localized()
    assert here is not None
    assert (here.pose.x, here.pose.y, here.pose.theta) == pytest.approx((1.0, 2.0, 0.5))


@pytest.mark.compiled
def test_a_reset_empties_the_map() -> None:
    chosen = settings()
    perception = Perception(chosen.ring, chosen.models, chosen.perception)
    for firing in drive(load_world("hallway"), (-6.0, 5.0)):
        perception.observe(firing)
        settle(perception)
    assert perception.objects()
    perception.reset()
    assert perception.objects() == ()
    assert not perception.can_refine
    assert len(perception.obstacles(1e9, math.inf)) == 0
    for firing in drive(load_world("hallway")):
        perception.observe(firing)
        settle(perception)
    assert len(perception.objects()) == 6


@pytest.mark.compiled
def test_of_two_models_the_better_fit_is_reported() -> None:
    shipped = settings()
    models = (load_model("box"), load_model("semicircle"))
    perception = Perception(shipped.ring, models, shipped.perception)
    for firing in drive(load_world("hallway")):
        perception.observe(firing)
        settle(perception)
    assert [o.model for o in perception.objects()].count("drum") == 6
