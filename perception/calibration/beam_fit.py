"""Directions of the sensors and the width of their beams, from the bearings under which surfaces answer.

A mirror answers while its normal lies in the beam: the middle between the first and the last bearing that answers is
the sensor's axis. Where everything in the beam answers, a surface beside the beam is heard at the beam's edge,
farther away the farther the beam has turned from it. Both are tried, and the likelier one counts.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from perception.kernel import Floats

TURN_MAX_RAD: Final = math.radians(8.0)
"""Greatest error of a direction that is looked for."""
TURN_STEPS_RAD: Final = (math.radians(0.5), math.radians(0.05))
"""Coarse and fine step of that search; the estimate is the mean over the fine one."""
HALF_ANGLES_RAD: Final = tuple(math.radians(degrees) for degrees in range(4, 31, 2))
"""Half angles of the beam that are tried, and then those between."""
HALF_ANGLE_STEP_RAD: Final = math.radians(0.25)
"""Step of the second search."""
HIT_SHARE: Final = 0.97
"""Probability that a surface in the beam answers; and that there is silence without one."""
STRAY_M: Final = 5.0
"""Width of the ranges over which a stray reading may fall, m."""
LOOKS_MIN: Final = 12
"""Looks near each edge of the beam that a sensor's direction needs."""


@dataclass(frozen=True, slots=True, eq=False)
class Looks:
    """Readings of sensors near the bearing of a surface, each an array of shape (m,)."""

    sensor: NDArray[np.intp]
    """The sensor."""
    bearing: Floats
    """Bearing of the surface's nearest point from the sensor's nominal axis, rad."""
    distance: Floats
    """Distance of that point, m."""
    radius: Floats
    """Radius of a round object, m; inf for a wall."""
    read: Floats
    """The reading, m; inf for silence."""
    sigma: Floats
    """Its standard deviation, m."""


@dataclass(frozen=True, slots=True, eq=False)
class BeamFit:
    """Directions and width of the beams."""

    turns: Floats
    """(n,): what to add to each sensor's nominal direction, rad; 0 where too few looks show it."""
    sigmas: Floats
    """(n,): its standard deviation, rad; inf where too few looks show it."""
    half_angle: float
    """Half of the beam's opening, rad."""
    everything_echoes: bool
    """Whether all in the beam answers, not only mirrors."""


def fit_beams(looks: Looks, sensors: int) -> BeamFit:
    """Return the directions and the common width that explain the looks best.

    Parameters
    ----------
    looks
        Those of all sensors.
    sensors
        Number of sensors of the ring.
    """
    half_angle, everything = best_beam(looks, sensors)
    return fit_directions(looks, sensors, half_angle, everything=everything)


def best_beam(looks: Looks, sensors: int) -> tuple[float, bool]:
    """Return half of the likeliest beam's opening, rad, and whether all in it answers.

    Parameters
    ----------
    looks, sensors
        As for `fit_beams`.
    """
    coarse = _turns(TURN_STEPS_RAD[0])
    half_angle, everything = _likeliest(looks, sensors, coarse, HALF_ANGLES_RAD, (False, True))
    between = (half_angle + k * HALF_ANGLE_STEP_RAD for k in range(-7, 8))
    return _likeliest(looks, sensors, coarse, between, (everything,))


def fit_directions(looks: Looks, sensors: int, half_angle: float, *, everything: bool) -> BeamFit:
    """Return the directions that explain the looks best, of sensors whose beam is known.

    Parameters
    ----------
    looks, sensors
        As for `fit_beams`.
    half_angle
        Half of the beam's opening, rad.
    everything
        Whether all in the beam answers, not only mirrors.
    """
    fine = _turns(TURN_STEPS_RAD[1])
    likelihood = _likelihoods(looks, sensors, fine, half_angle, everything=everything)
    share = np.exp(likelihood - likelihood.max(axis=1, keepdims=True))
    share /= share.sum(axis=1, keepdims=True)
    mean = share @ fine
    sigma = np.sqrt(np.maximum(share @ fine**2 - mean**2, (0.5 * TURN_STEPS_RAD[1]) ** 2))
    edge = np.abs(np.abs(looks.bearing) - half_angle) < TURN_MAX_RAD
    for side in (looks.bearing < 0.0, looks.bearing > 0.0):
        few = np.bincount(looks.sensor[edge & side], minlength=sensors) < LOOKS_MIN
        mean[few], sigma[few] = 0.0, math.inf
    return BeamFit(mean, sigma, half_angle, everything)


def _turns(step_rad: float) -> Floats:
    """Return the errors of a direction that are tried, rad."""
    return np.arange(-TURN_MAX_RAD, TURN_MAX_RAD + 0.5 * step_rad, step_rad)


def _likeliest(
    looks: Looks, sensors: int, turns: Floats, half_angles: Iterable[float], kinds: Iterable[bool]
) -> tuple[float, bool]:
    """Return the likeliest half angle, and whether everything echoes, each sensor turned as fits it best."""
    tried = [(half_angle, everything) for everything in kinds for half_angle in half_angles]
    return max(
        tried,
        key=lambda beam: float(_likelihoods(looks, sensors, turns, beam[0], everything=beam[1]).max(axis=1).sum()),
    )


def _likelihoods(looks: Looks, sensors: int, turns: Floats, half_angle: float, *, everything: bool) -> Floats:
    """Return the log likelihood of each turn of each sensor, shape (sensors, turns)."""
    total = np.zeros((sensors, len(turns)))
    heard = np.isfinite(looks.read)
    for k, turn in enumerate(turns.tolist()):
        beside = np.maximum(0.0, np.abs(looks.bearing - turn) - half_angle)
        expected = _expected_m(looks, beside) if everything else np.where(beside > 0.0, np.inf, looks.distance)
        answers = np.isfinite(expected)
        off = np.where(answers & heard, (looks.read - np.where(answers, expected, 0.0)) / looks.sigma, 0.0)
        echo = (
            HIT_SHARE * np.exp(-0.5 * off**2) / (math.sqrt(2.0 * math.pi) * looks.sigma) + (1.0 - HIT_SHARE) / STRAY_M
        )
        chance = np.where(
            heard,
            np.where(answers, echo, (1.0 - HIT_SHARE) / STRAY_M),
            np.where(answers, 1.0 - HIT_SHARE, HIT_SHARE),
        )
        total[:, k] = np.bincount(looks.sensor, weights=np.log(chance), minlength=sensors)
    return total


def _expected_m(looks: Looks, beside: Floats) -> Floats:
    """Return the range of a surface whose nearest point lies by an angle beside the beam, m; inf if none is in it."""
    centre = looks.distance + np.where(np.isfinite(looks.radius), looks.radius, 0.0)
    sideways, ahead = centre * np.sin(beside), np.cos(beside)
    depth = np.where(np.isfinite(looks.radius), looks.radius, 0.0) ** 2 - sideways**2
    drum = np.where(depth >= 0.0, centre * ahead - np.sqrt(np.maximum(depth, 0.0)), np.inf)
    wall = np.where(beside < 0.5 * math.pi, looks.distance / np.maximum(ahead, 1e-9), np.inf)
    expected: Floats = np.where(np.isfinite(looks.radius), drum, wall)
    return expected
