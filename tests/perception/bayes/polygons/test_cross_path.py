"""Cross paths over boxes against the shortest way that obeys Fermat, and their evidence."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest

from config.world import BoxConfig, WorldConfig
from perception.bayes.inference.likelihood import level_of, log_likelihood
from perception.bayes.polygons import cross_path as polygon_cross_path
from tests import naive_acoustics
from tests.perception.bayes.box_readings import CLOSED, sides_between
from tests.perception.bayes.cross_cases import P, crosses, stand
from tests.perception.bayes.random_tracks import examples


@examples(40, 1500)
def test_half_the_way_over_a_box_is_the_shortest_by_both_rules(examples: int) -> None:
    rng, heard = np.random.default_rng(6), 0
    for _ in range(examples):
        t, l, towards, gap = stand(rng)  # noqa: E741
        width, depth, turn = (float(v) for v in rng.uniform((0.2, 0.2, 0.0), (0.9, 0.9, 90.0)))
        place = 0.5 * (t + l) + (gap + 0.6) * towards
        box = BoxConfig(x_m=place.real, y_m=place.imag, width_m=width, depth_m=depth, angle_deg=turn)
        shapes = naive_acoustics.shapes_of(WorldConfig(box=(box,)))
        sides = sides_between(0.5 * np.array([width, depth]) * [(-1, -1), (1, -1), (1, 1), (-1, 1)], CLOSED)
        heading, axis, across = math.radians(turn), t / abs(t), l - t
        one = crosses(np.array([[t.real, t.imag, axis.real, axis.imag, 1.0, across.real, across.imag]]))
        q = one[0]
        at, price, at_cone = polygon_cross_path.predict_cross(
            q, place.real, place.imag, math.cos(heading), math.sin(heading), sides, CLOSED, P
        )
        emitter = (t, cmath.phase(t), math.acos(P[0].cos_may_answer))
        want = naive_acoustics.cross_specular(shapes, emitter, (l, 0.0, math.pi), math.inf, 1e-6)
        assert min(at, 1e17) == pytest.approx(min(want, 1e17), abs=1e-6)
        assert at_cone <= at + 1e-12
        if at < 1e17:
            q.range_m = at + 0.004
            got = polygon_cross_path.score_crosses(
                one, 1, (place.real, place.imag, math.cos(heading), math.sin(heading)), sides, CLOSED, P, 0
            )
            v = max(0.0, log_likelihood(P, level_of(P, 0, q.range_m), 0.004) - price)
            assert got[:3] == pytest.approx((v, 1.0, float(v > 0.0)), abs=1e-6)
        heard += at < 1e17
    assert heard > examples // 8
