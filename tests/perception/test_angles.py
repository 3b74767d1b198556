"""Angles in kernels are wrapped as elsewhere."""

from __future__ import annotations

import math

import numpy as np

from drivers.messages import wrap_angle
from perception.angles import wrapped


def test_an_angle_is_wrapped_as_outside_of_kernels() -> None:
    rng = np.random.default_rng(0)
    for angle in [*rng.uniform(-20.0, 20.0, 500).tolist(), math.pi, -math.pi, 0.0]:
        assert wrapped(angle) == wrap_angle(angle)
        assert -math.pi <= wrapped(angle) < math.pi
