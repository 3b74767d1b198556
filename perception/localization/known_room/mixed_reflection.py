"""The probability of a range in a room of which it is not known how it reflects: a mixture of its causes.

Rough surfaces answer from the nearest point in the beam (`cone`), smooth ones from the foot of the perpendicular
(`specular`). Most rooms have both. A smooth surface that sends no sound straight back is silent, or answers late,
over a second surface. One whose foot is a little beside the beam may answer too, for no beam has a sharp edge, and no
wall is quite smooth: which beams hold an echo is what the heading is known from. And a real room has more than its
map: a reading may be anything. How often each of these is the cause is learned on the way.
"""

from __future__ import annotations

import math
from typing import Final, Protocol

import numpy as np

from perception.bounds import Share, bounds
from perception.kernel import Floats, kernel
from perception.localization.known_room.surroundings import SensorModel
from perception.localization.room.range_likelihood import HEARD_PRIOR
from perception.records import Record, Records, records, zeros

WILD_HEARD: Final = 0.9
"""Share of the readings that may be anything which hear something: they are of what the map lacks."""
LATE_M: Final = 2.0
"""An echo over a second surface is late by up to this."""
SHARES: Final = (0.5, 0.1, 0.1, 0.2)
"""Shares at the start, in the order of `Shares`."""
SHARES_MIN: Final = (0.03, 0.02, 0.05, 0.02)
"""Lower bounds of the shares."""
SHARES_MAX: Final = (0.97, 0.5, 0.4, 0.9)
"""Upper bounds of the shares."""
ROOMS: Final = (SHARES, (0.8, 0.25, 0.1, 0.4))
"""What a search tries while nothing was learned: those, and the shares of a real building of smooth surfaces. Between
mirrors the right place is with the former hardly better than others."""


class Shares(Record):
    """How often a reading has which cause, as learned so far."""

    specular: Share
    """Share of the readings that are from a smooth surface."""
    late: Share
    """Share of the smooth surfaces without a straight way back that answer over a second one."""
    wild: Share
    """Share of the readings that are anything."""
    beside: Share
    """Share of the smooth surfaces a little beside the beam that answer."""


MEMORY_READINGS: Final = 300.0
"""Readings over which shares are learned."""
MEMORY_BESIDE: Final = 60.0
"""Readings of smooth surfaces beside the beam over which it is learned how many answer: they are few."""

Causes = tuple[float, float, float, float, float, float, float, float]
"""Probabilities that a reading is what `cone` expects, what `specular` expects, and what a smooth surface beside the
beam sends; that it is of a smooth surface, of one without a straight way back, of such a one that answers over a
second surface; that it is anything; and that a smooth surface beside the beam could have answered."""


class Counted(Protocol):
    """Causes of some readings, as in `Causes`, summed."""

    specular: float
    turned_away: float
    late: float
    wild: float
    beside: float
    could_beside: float


class LearnedShares:
    """How often a reading has which cause, learned from the causes of readings at a place that is known.

    Attributes
    ----------
    records : (1,) Shares
        As kernels take them.
    is_learned : bool
        Whether a known place has shown any.
    """

    SCRATCH: Final = ("records",)
    """A view of other memory."""
    BOUNDS: Final = bounds(_memory=Shares.BOUNDS)

    def __init__(self) -> None:
        self._memory = zeros(Shares, 1)
        self.records: Records[Shares] = records(Shares, self._memory)
        self.reset()

    def reset(self) -> None:
        """Forget what was learned."""
        self._memory[0] = SHARES
        self.is_learned = False

    def profiles(self) -> Floats:
        """Return what a search is to try, shape (1 or 2, 3), as of `perception.localization.known_room.pose_grid`."""
        share = self.records[0]
        if self.is_learned:
            return np.array([(share.specular, share.late, share.wild)])
        return np.array([room[:3] for room in ROOMS])

    def guess(self, profile: int) -> None:
        """Take what fits best of what a search has tried, as long as nothing was learned."""
        if not self.is_learned:
            self._memory[0] = ROOMS[profile]

    def learn(self, causes: Counted, readings: int) -> None:
        """Take the causes of some readings."""
        self.is_learned = True
        share, least, most = self.records[0], SHARES_MIN, SHARES_MAX
        specular = share.specular + (causes.specular - share.specular * readings) / MEMORY_READINGS
        late = share.late + (causes.late - share.late * causes.turned_away) / MEMORY_READINGS
        wild = share.wild + (causes.wild - share.wild * readings) / MEMORY_READINGS
        beside = share.beside + (causes.beside - share.beside * causes.could_beside) / MEMORY_BESIDE
        share.specular = min(most[0], max(least[0], specular))
        share.late = min(most[1], max(least[1], late))
        share.wild = min(most[2], max(least[2], wild))
        share.beside = min(most[3], max(least[3], beside))


@kernel
def range_variance(sensor: Records[SensorModel], range_m: float) -> float:
    """Return the variance of a range, m²; at silence, that of the farthest range."""
    r = min(range_m, sensor[0].window_m) * sensor[0].noise_relative
    return sensor[0].variance + r * r


@kernel
def echo_density(sensor: Records[SensorModel], measured: float, expected: float, variance: float) -> float:
    """Return the density (1/m) of an echo that a surface in the map sends, or the probability of silence.

    Parameters
    ----------
    sensor : (1,) SensorModel
        Errors of a range.
    measured, expected : float
        Ranges, m; inf for silence, which no expectation may be.
    variance : float
        Of the expected range, from the pose's, m².
    """
    if measured == math.inf:
        return sensor[0].dropout
    total = range_variance(sensor, expected) + variance
    error = measured - expected
    return (1.0 - sensor[0].dropout) / math.sqrt(2.0 * math.pi * total) * math.exp(-0.5 * error * error / total)


@kernel
def mixed_ratio(
    sensor: Records[SensorModel],
    measured: float,
    cone_m: float,
    cone_variance: float,
    specular_m: float,
    specular_variance: float,
    beside_m: float,
    beside_variance: float,
    shares: Records[Shares],
) -> tuple[float, Causes]:
    """Return how well a reading fits: its log likelihood ratio to a reading from anywhere, nat, and its causes.

    Parameters
    ----------
    sensor : (1,) SensorModel
        Errors of a range.
    measured : float
        Range, m; inf for silence.
    cone_m, specular_m : float
        Expected by either model, m; inf for silence, and so is what is beyond the window.
    beside_m : float
        That of a mirror beside the beam, m; inf for none.
    cone_variance, specular_variance, beside_variance : float
        Of the expected ranges, from the pose's, m².
    shares : (1,) Shares
        How often a reading has which cause.
    """
    share, window_m = shares[0], sensor[0].window_m
    is_silent = measured == math.inf
    known = 1.0 - share.wild
    wild = share.wild * (1.0 - WILD_HEARD if is_silent else WILD_HEARD / window_m)
    smooth = share.specular * known
    rough = mirror = beside = away = late = could_beside = 0.0
    if cone_m <= window_m:
        rough = (1.0 - share.specular) * known * echo_density(sensor, measured, cone_m, cone_variance)
    elif is_silent:
        rough = (1.0 - share.specular) * known
    if beside_m <= window_m:
        beside = share.beside * smooth * echo_density(sensor, measured, beside_m, beside_variance)
        smooth *= 1.0 - share.beside
    if specular_m <= window_m:
        mirror = smooth * echo_density(sensor, measured, specular_m, specular_variance)
    else:
        away = smooth
        if is_silent:
            away *= 1.0 - share.late
        elif cone_m < measured <= cone_m + LATE_M:
            late = away * share.late / LATE_M
            away = 0.0
        else:
            away = 0.0
    total = rough + mirror + beside + away + late + wild
    if beside_m <= window_m:
        could_beside = (mirror + beside + away + late) / total
    anywhere = 1.0 - HEARD_PRIOR if is_silent else HEARD_PRIOR / window_m
    causes = (
        rough / total,
        mirror / total,
        beside / total,
        (mirror + beside + away + late) / total,
        (away + late) / total,
        late / total,
        wild / total,
        could_beside,
    )
    return math.log(total / anywhere), causes
