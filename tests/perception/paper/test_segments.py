"""Kernels that make outline segments against their oracles in tests/naive.py, on random cases."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.paper.segments import SensorReadings, pair_readings, tangent
from perception.records import records, zeros
from tests import naive
from tests.perception.random_outlines import EXACT


def test_tangent_equals_its_oracle() -> None:
    rng = np.random.default_rng(1)
    found = 0
    for _ in range(4_000):
        x1, y1, axis1 = rng.uniform(-3, 3, 3)
        x2, y2 = x1 + rng.uniform(-0.5, 0.5), y1 + rng.uniform(-0.5, 0.5)
        axis2 = axis1 + rng.uniform(-0.3, 0.3)
        r1 = rng.uniform(0.2, 5)
        r2 = r1 + rng.uniform(-0.4, 0.4)
        half = rng.uniform(0.05, 1.5)
        first, second = naive.Reading(x1, y1, axis1, r1, 0.0), naive.Reading(x2, y2, axis2, r2, 0.0)
        expected = naive.tangent(first, second, half)
        ok, alpha = tangent(x1, y1, axis1, r1, x2, y2, axis2, r2, half)
        assert ok == (expected is not None)
        if expected is not None:
            found += 1
            steep = math.sqrt(1.0 - ((r1 - r2) / math.hypot(x2 - x1, y2 - y1)) ** 2)
            assert naive.angle_between(alpha, expected) < EXACT / steep  # dα/dr is 1/(L·steep): what rounding leaves
            n1 = math.cos(alpha) * x1 + math.sin(alpha) * y1 + r1
            n2 = math.cos(alpha) * x2 + math.sin(alpha) * y2 + r2
            assert n1 == pytest.approx(n2, abs=EXACT)  # the defining property, to full precision
    assert found > 600


def test_tangent_of_a_wall_is_the_wall() -> None:
    """A sensor before a wall at x = 2 faces it at an angle of 0.1 rad and moves along and towards it."""
    ok, alpha = tangent(0.0, 0.0, 0.1, 2.0, 0.1, 0.3, 0.1, 1.9, 0.2)
    assert ok
    assert alpha == pytest.approx(0.0, abs=EXACT)


def test_no_tangent_outside_the_beams_nor_for_impossible_ranges() -> None:
    assert not tangent(0.0, 0.0, 1.0, 2.0, 0.1, 0.3, 1.0, 1.9, 0.2)[0]
    assert not tangent(0.0, 0.0, 0.0, 2.0, 0.0, 0.3, 0.0, 2.5, 1.5)[0]
    assert not tangent(0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 2.0, 1.5)[0]


@pytest.mark.covered
def test_pairing_equals_its_oracle_along_random_drives() -> None:
    rng = np.random.default_rng(2)
    made = 0
    for _ in range(12):
        mounts = np.column_stack([rng.uniform(-0.4, 0.4, (6, 2)), rng.uniform(-math.pi, math.pi, 6)])
        sensors = records(SensorReadings, zeros(SensorReadings, 6))
        out = np.zeros((6, 5))
        history: list[list[naive.Reading]] = [[] for _ in range(6)]
        x, y, yaw, t, spacing = 0.0, 0.0, 0.0, 0.0, 0.05
        base = rng.uniform(1.0, 3.0, 6)
        for _ in range(60):
            x, y, yaw = x + rng.uniform(0, 0.08), y + rng.uniform(-0.02, 0.02), yaw + rng.uniform(-0.02, 0.02)
            t += float(rng.choice([0.05, 0.1, 0.7]))
            ranges = base + rng.uniform(-0.05, 0.05, 6)
            ranges[rng.uniform(size=6) < 0.1] = math.nan
            ranges[rng.uniform(size=6) < 0.1] = math.inf
            n = pair_readings(ranges, mounts, (x, y, yaw), t, sensors, 0.6, (0.2, 0.4, 2.0, spacing), out)
            expected = []
            for i in range(6):
                if not math.isfinite(ranges[i]):
                    continue
                place = complex(x, y) + complex(mounts[i, 0], mounts[i, 1]) * complex(math.cos(yaw), math.sin(yaw))
                new = naive.Reading(place.real, place.imag, yaw + mounts[i, 2], ranges[i], t)
                last = history[i][-1] if history[i] else None
                if last and t - last.t <= 2.0 and math.dist((last.x, last.y), (new.x, new.y)) < spacing:
                    continue
                segment = naive.extract(history[i], new, 0.6, 0.2, 0.4, 2.0)
                if segment is not None:
                    expected.append(segment)
                history[i] = [*history[i], new][-16:]
            assert n == len(expected)
            made += n
            np.testing.assert_allclose(out[:n, :4], np.array(expected).reshape(-1, 5)[:, :4], atol=EXACT)
    assert made > 400
