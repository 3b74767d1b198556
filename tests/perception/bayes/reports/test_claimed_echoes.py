"""Echoes that walls explain, against rays cast one by one."""

from __future__ import annotations

import math

import numpy as np

from perception.bayes.memory.elements import BEARING_BINS, Reading
from perception.bayes.reports.claimed_echoes import own_echoes
from tests.naive_walls import Array
from tests.perception.bayes.random_tracks import P, S, examples, pair
from tests.perception.bayes.rooms import SIGMA, keep, new_room, reading

SLACK_M = 0.03 + 3.2 * SIGMA
NEAR_M = 0.002
"""Cases this near to a limit are left out: rays are cast at steps."""


def reach(sensor: Array, angle: float, surface: Array) -> float:
    """Return where a ray meets a straight surface, m."""
    ray, along = np.array([math.cos(angle), math.sin(angle)]), surface[2:] - surface[:2]
    matrix = np.column_stack([ray, -along])
    if abs(np.linalg.det(matrix)) < 1e-12:
        return math.inf
    distance, share = np.linalg.solve(matrix, surface[:2] - sensor)
    return float(distance) if distance > 0.0 and 0.0 <= share <= 1.0 else math.inf


def claimed(q: Reading, centre: Array, surface: Array, are_mirrors: bool) -> tuple[bool, bool]:
    """Return whether a surface explains an echo, and whether that is decided by less than the steps."""
    sensor, axis = np.array([q.x, q.y]), math.atan2(q.axis_y, q.axis_x)
    before = reach(sensor, math.atan2(*(centre - sensor)[::-1]), surface)
    nearest = math.inf
    if are_mirrors:  # the foot of the perpendicular, or an end
        share = np.linspace(0.0, 1.0, 2001)[:, None]
        points = surface[:2] + share * (surface[2:] - surface[:2]) - sensor
        point = points[np.argmin(np.hypot(*points.T))]
        off = (math.atan2(point[1], point[0]) - axis + math.pi) % (2.0 * math.pi) - math.pi
        if abs(off) < math.acos(float(P[0].cos_may_answer)):
            nearest = float(np.hypot(*point))
    else:
        for angle in axis + np.linspace(-S.half_angle_rad, S.half_angle_rad, 101):
            nearest = min(nearest, reach(sensor, float(angle), surface))
    decided = min(abs(abs(q.range_m - nearest) - SLACK_M), abs(q.range_m - SLACK_M - before)) > NEAR_M
    return abs(q.range_m - nearest) < SLACK_M or before < q.range_m - SLACK_M, decided


@examples(12, 300)
def test_own_echoes_are_those_that_no_surface_answers_or_hides(examples: int) -> None:
    rng, own, decided = np.random.default_rng(60), [0, 0], 0
    for k in range(examples):
        memory, room = new_room()
        room.edge_silences = 50.0 * (k % 2)
        track, centre = memory.tracks[0], rng.uniform(-0.2, 0.2, 2)
        track.x, track.y = centre.tolist()
        track.radius = 0.3
        surfaces = rng.uniform(-1.5, 1.5, (2, 4))
        echoes, is_own, is_decided = [], 0, True
        for _ in range(min(8, BEARING_BINS)):
            away, angle = float(rng.uniform(0.8, 2.0)), float(rng.uniform(-math.pi, math.pi))
            sensor = centre - away * np.array([math.cos(angle), math.sin(angle)])
            axis, range_m = angle + float(rng.uniform(-0.1, 0.1)), away - 0.3 + float(rng.normal(0, 0.03))
            q = reading(*pair(sensor), axis, range_m)
            if abs(q.range_m - away + 0.3) > P[0].gate_m - NEAR_M:
                continue
            said = [claimed(q, centre, surface, k % 2 == 1) for surface in surfaces]
            echoes.append(q)
            is_own += not any(it for it, _ in said)
            is_decided = is_decided and all(it for _, it in said)
        keep(track, echoes)
        if is_decided:
            decided += 1
            assert own_echoes(memory.circles[:2], surfaces, memory, P).tolist() == [is_own, 0]
            own[0] += is_own
            own[1] += len(echoes) - is_own
    assert decided > 0.5 * examples
    assert min(own) > 0
