"""Noise: directions that are kept for a while, and that nothing but the seed and the time decides."""

from __future__ import annotations

import math

import numpy as np
import pytest

from behaviors.noise import noise
from config.behaviors import NoiseConfig

NOISE = NoiseConfig(noise_gain=0.5, persistence_s=2.0, seed=3)


def test_noise_keeps_its_direction_for_a_while_and_a_seed_repeats_it() -> None:
    headings = [math.atan2(r.y, r.x) for r in (noise(2.0 * k + 0.3, NOISE) for k in range(400))]
    later = [math.atan2(r.y, r.x) for r in (noise(2.0 * k + 1.9, NOISE) for k in range(400))]
    assert headings == later
    assert math.hypot(noise(7.0, NOISE).x, noise(7.0, NOISE).y) == pytest.approx(0.5)
    counts = np.histogram(headings, 8, (-math.pi, math.pi))[0]
    assert counts.min() > 25  # 50 expected
    other = NOISE.model_copy(update={"seed": 4})
    assert headings != [math.atan2(r.y, r.x) for r in (noise(2.0 * k + 0.3, other) for k in range(400))]
