"""Readings entered into particles, against the formulas written out with numpy's matrices."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bench.trials.random_rooms import ACOUSTICS
from drivers.messages import Pose
from perception.kernel import Floats
from perception.localization.known_room.mixed_reflection import SHARES
from perception.localization.known_room.particle_update import COLUMNS, inverse, update_particles
from perception.localization.known_room.pose_particles import HEADINGS, ParticleScratch, conclude
from perception.localization.known_room.surroundings import make_surroundings
from perception.localization.room.range_likelihood import RangeModel
from perception.records import records, zeros
from tests.naive_known_room import naive_update
from tests.perception.localization.known_room.test_mixed_reflection import shares_of
from tests.perception.localization.known_room.test_pose_particles import (
    FIELDS,
    covariance_of,
    hypotheses_at,
    particles,
)
from tests.perception.localization.rooms import CROOKED, HALF_ANGLE, RING, panorama_of, stand, world_of

MODEL = RangeModel.of_ring(RING)
TRUTH = Pose(1.5, 2.2, 0.5)
ROOM, FIRING = stand(world_of(CROOKED, ACOUSTICS), TRUTH)


def readings() -> Floats:
    """The readings of a stand as rows."""
    found = panorama_of(FIRING)
    return np.column_stack([found.x, found.y, np.cos(found.axis), np.sin(found.axis), found.range_m])


def test_an_update_is_the_formulas() -> None:
    found, rows = hypotheses_at((TRUTH.x + 0.1, TRUTH.y - 0.08, TRUTH.theta + 0.02)), readings()
    assert rows.shape == (24, COLUMNS)
    before = particles(found).copy()
    update_particles(make_surroundings(ROOM, MODEL, HALF_ANGLE), found, 0, 4, 7, rows, 24, shares_of(SHARES))
    after = particles(found)
    assert np.array_equal(after[:4], before[:4])
    assert np.array_equal(after[7:], before[7:])
    for i in (4, 6):
        mean = np.array([before[i][name] for name in FIELDS])
        heading = float(before[i]["heading"])
        oracle = naive_update(ROOM, MODEL, HALF_ANGLE, heading, mean, covariance_of(before[i]), rows, SHARES)
        assert [after[i][name] for name in FIELDS] == pytest.approx(oracle.mean)
        assert covariance_of(after[i]) == pytest.approx(oracle.covariance)
        assert after[i]["log_weight"] - before[i]["log_weight"] == pytest.approx(oracle.log_weight)
        assert after[i]["log_ratio"] == pytest.approx(oracle.log_ratio)
        causes = oracle.causes
        assert after[i]["specular"] == pytest.approx(causes.mirror + causes.beside + causes.away + causes.late)
        assert (after[i]["beside"], after[i]["could_beside"]) == pytest.approx((causes.beside, oracle.could_beside))
        assert after[i]["turned_away"] == pytest.approx(causes.away + causes.late)
        assert (after[i]["late"], after[i]["wild"]) == pytest.approx((causes.late, causes.wild))


@pytest.mark.covered
def test_an_update_finds_the_place_and_the_heading_and_prefers_the_right_hypothesis() -> None:
    found = hypotheses_at((TRUTH.x + 0.1, TRUTH.y - 0.08, TRUTH.theta + 0.02), (TRUTH.x, TRUTH.y + 1.0, 2.0))
    around = make_surroundings(ROOM, MODEL, HALF_ANGLE)
    for h in range(2):
        update_particles(around, found, h, 0, HEADINGS, readings(), 24, shares_of(SHARES))
    assert particles(found, 0)["log_ratio"].max() > particles(found, 1)["log_ratio"].max() + 20.0
    conclude(found, 12.0, 40, records(ParticleScratch, zeros(ParticleScratch, 1)))
    best = found[0].best
    assert found[0].count == 1
    assert best.specular > 12.0
    assert (best.x, best.y) == pytest.approx((TRUTH.x, TRUTH.y), abs=0.03)
    assert best.heading == pytest.approx(TRUTH.theta, abs=math.radians(2.0))
    assert 0.0 < math.sqrt(best.xx) < 0.02


def test_the_inverse_of_a_symmetric_matrix() -> None:
    root = np.random.default_rng(2).normal(size=(3, 3))
    matrix = root @ root.T + np.eye(3)
    *found, det = inverse(*matrix[np.triu_indices(3)].tolist())
    assert found == pytest.approx(np.linalg.inv(matrix)[np.triu_indices(3)])
    assert det == pytest.approx(np.linalg.det(matrix))
