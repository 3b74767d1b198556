"""Segments of the contour: the lines that explain a run of ranges."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bench.trials.random_rooms import random_room
from config.world import AcousticsConfig
from drivers.messages import Firing, Pose
from perception.localization.drumheller.contour import ContourSegment, contour_segments
from perception.localization.room.expected_ranges import Reflection
from perception.localization.room.range_likelihood import RangeModel
from tests import naive
from tests.perception.localization.rooms import EXACT, HALF_ANGLE, RECTANGLE, RING, panorama_of, stand, world_of

MODEL = RangeModel.of_ring(RING)
TRUTH = Pose(1.5, 1.2, 0.4)


def segments_in_rectangle(reflection: Reflection) -> tuple[ContourSegment, ...]:
    """The segments of exact readings in the rectangle of 5 m by 3 m."""
    _, firing = stand(world_of(RECTANGLE, AcousticsConfig(model=reflection)), TRUTH, ring=EXACT)
    return contour_segments(panorama_of(firing), HALF_ANGLE, reflection, MODEL)


@pytest.mark.parametrize(("reflection", "readings"), [("cone", 2), ("specular", 1)])
def test_every_wall_of_a_rectangle_is_a_segment(reflection: Reflection, readings: int) -> None:
    found = segments_in_rectangle(reflection)
    for direction, distance in ((0.0, 3.5), (math.pi / 2, 1.8), (math.pi, 1.5), (-math.pi / 2, 1.2)):
        near = [
            one
            for one in found
            if abs(naive.angle_between(one.alpha + TRUTH.theta, direction)) <= one.alpha_slack
            and abs(one.offset - distance) < 0.05
            and one.readings >= readings
        ]
        assert near, (direction, found)


def test_the_longest_segment_comes_first_and_then_the_nearest() -> None:
    order = [(-one.readings, one.offset) for one in segments_in_rectangle("cone")]
    assert order == sorted(order)
    assert order[0][0] <= -5


@pytest.mark.covered
def test_two_neighbours_on_mirrors_hold_the_tangent_of_their_arcs() -> None:
    """McKerrow's construction on exact ranges gives one of the lines that explain the run."""
    pairs = 0
    for seed in range(20):
        world, truth = random_room(seed, AcousticsConfig(model="specular"))
        panorama = panorama_of(stand(world, truth, ring=EXACT)[1])
        found = contour_segments(panorama, HALF_ANGLE, "specular", MODEL)
        columns = (panorama.x, panorama.y, panorama.axis, panorama.range_m)
        readings = [naive.Reading(x, y, axis, r, 0.0) for x, y, axis, r in zip(*columns, strict=True)]
        for k in range(24):
            if math.isinf(readings[k].range) or math.isinf(readings[k - 1].range):
                continue
            alpha = naive.tangent(readings[k - 1], readings[k], HALF_ANGLE)
            if alpha is not None:
                pairs += 1
                assert any(naive.angle_between(alpha, one.alpha) <= one.alpha_slack for one in found)
    assert pairs > 20


def test_a_run_goes_round_the_end_of_the_ring() -> None:
    """A wall straight ahead is heard by the last sensors and the first."""
    ranges = np.full(24, math.inf)
    ranges[[23, 0, 1]] = [2.0 / math.cos(math.radians(3.0)), 2.0, 2.0 / math.cos(math.radians(3.0))]
    (found,) = contour_segments(panorama_of(Firing(0.0, TRUTH, 0.0, ranges)), HALF_ANGLE, "cone", MODEL)
    assert found.readings == 3
    assert found.alpha == pytest.approx(0.0, abs=math.radians(1.0))
    assert found.offset == pytest.approx(2.381, abs=0.03)


def test_silence_has_no_segments() -> None:
    silence = Firing(0.0, TRUTH, 0.0, np.full(24, math.inf))
    assert contour_segments(panorama_of(silence), HALF_ANGLE, "cone", MODEL) == ()
