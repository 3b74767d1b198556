"""Random cross paths of a ring of 24, and the settings of a ring whose sensors listen."""

from __future__ import annotations

import cmath
import math

import numpy as np

from config.load import load_robot
from perception.bayes.inference.kernel_settings import make_settings
from perception.bayes.memory.elements import Reading
from perception.kernel import Floats
from perception.records import Records, records, zeros
from tests.perception.bayes.random_tracks import SETTINGS, numbers

P = make_settings(load_robot("ears").ring, SETTINGS.models, SETTINGS.perception.bayes)
RING_M, STEP = 0.381, math.radians(15.0)


def crosses(rows: Floats) -> Records[Reading]:
    """Return readings from rows of place, axis, half path and listener."""
    array = zeros(Reading, len(rows))
    numbers(array)[...] = rows
    return records(Reading, array)


def stand(rng: np.random.Generator, gap: tuple[float, float] = (0.3, 3.0)) -> tuple[complex, complex, complex, float]:
    """Return a transmitter, a listener up to four places on, a point ahead of them, and how far it is away."""
    t = RING_M * cmath.exp(1j * rng.uniform(-math.pi, math.pi))
    l = t * cmath.exp(1j * STEP * rng.choice([-4, -3, -2, -1, 1, 2, 3, 4]))  # noqa: E741
    towards = cmath.exp(1j * (cmath.phase(t + l) + rng.uniform(-0.4, 0.4)))
    return t, l, towards, float(rng.uniform(*gap))
