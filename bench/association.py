"""What every peer leaves to its user: association, gating, and the decision "is it a drum at all".

One is written for all of them, and its time is told apart from theirs. The centres that segments vote for found
tracks. Each range goes to the track that it fits best, within a gate round what the estimator believes of it; ranges
that fit nothing wait a while, in case a track is founded that explains them. A track is a drum where enough ranges
fit, few pulses went through it, and it was seen from enough sides. Tracks that come to lie on one another are one.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from bench.front_end import RADIUS_M, Place, Reading, Segment
from config.robot import RingConfig
from config.units import FOOT_M
from drivers.messages import Floats

FOUND_GATE_M: Final = 1.0 * FOOT_M
"""A vote farther than this from every track founds one; neighbouring drums are three feet apart."""
RIPE_VOTES: Final = 4
VOTES_AVERAGED: Final = 30
RANGE_GATE_FIRST_M: Final = 0.35 * FOOT_M
RANGE_GATE_M: Final = 0.2 * FOOT_M
SETTLED_HITS: Final = 12
"""After so many ranges the narrower gate holds."""
BEAM_SLACK: Final = 1.15
"""A range may come from this many beam half-angles off the axis: the track's place is not exact yet."""
BEAM_SURE: Final = 0.85
"""A pulse went through a track only where the track is well inside the beam."""
WAITING: Final = 240
"""Ranges that fit nothing yet and are kept."""
FORGOTTEN_AFTER: Final = 40
"""Readings after which a track that never ripened is dropped."""

DRUM_HITS: Final = 12
DRUM_HIT_SHARE: Final = 0.6
DRUM_SECTOR_RAD: Final = math.radians(5.0)
DRUM_SECTORS: Final = 12
"""A drum was seen from so many directions, five degrees wide each; passing by one gives twice as many."""


@dataclass(frozen=True, slots=True)
class RangeHit:
    """A range given to a track: the reading, the ring's place then, the sensor's mount and place, m."""

    track: int
    reading: int
    ring: tuple[float, float, float]
    mount: Place
    x: float
    y: float
    range_m: float


@dataclass(frozen=True, slots=True)
class Evidence:
    """What one reading says, associated."""

    begun: Mapping[int, Place]
    """Tracks that ripened with this reading, and a first guess of their centre."""
    ranges: tuple[RangeHit, ...]
    segments: tuple[tuple[int, Segment], ...]
    confirmed: tuple[int, ...]
    """Tracks that are drums, the best supported first."""


@dataclass(slots=True)
class Track:
    """Something that may be a drum."""

    x: float
    y: float
    last: int
    votes: int = 1
    hits: int = 0
    misses: int = 0
    sectors: set[int] = field(default_factory=set)

    @property
    def ripe(self) -> bool:
        """Whether the first guess is worth giving to an estimator."""
        return self.votes >= RIPE_VOTES

    @property
    def confirmed(self) -> bool:
        """Whether it is a drum."""
        enough = self.hits >= max(DRUM_HITS, DRUM_HIT_SHARE * (self.hits + self.misses))
        return self.ripe and enough and len(self.sectors) >= DRUM_SECTORS


class Association:
    """Readings in, associated evidence out.

    Parameters
    ----------
    ring
        The sensors.
    """

    def __init__(self, ring: RingConfig) -> None:
        self._mounts = [(mount.x_m, mount.y_m) for mount in ring.mounts]
        self._half_angle = math.radians(ring.beam_half_angle_deg)
        self._tracks: dict[int, Track] = {}
        self._waiting: deque[tuple[Reading, int]] = deque(maxlen=WAITING)
        self._founded = 0

    def take(self, reading: Reading, believed: Mapping[int, Place]) -> Evidence:
        """Associate one reading.

        Parameters
        ----------
        reading
            The reading.
        believed
            Where the estimator has its tracks by now; the mean of the votes serves where it says nothing.
        """
        self._tidy(reading.number, believed)
        begun: dict[int, Place] = {}
        segments = tuple(
            (self._vote(segment, reading.number, believed, begun), segment) for segment in reading.segments
        )
        hits: list[RangeHit] = []
        for k in begun:
            hits += self._late(k)
        hits += self._associate(reading, believed)
        drums = sorted(((t.hits, k) for k, t in self._tracks.items() if t.confirmed), reverse=True)
        return Evidence(begun, tuple(hits), segments, tuple(k for _, k in drums))

    def _where(self, k: int, believed: Mapping[int, Place]) -> Place:
        track = self._tracks[k]
        return believed.get(k, (track.x, track.y))

    def _vote(self, segment: Segment, now: int, believed: Mapping[int, Place], begun: dict[int, Place]) -> int:
        """Give a segment to the nearest track, or found one; return which."""
        x = segment.ends[1][0] + RADIUS_M * math.cos(segment.normal)
        y = segment.ends[1][1] + RADIUS_M * math.sin(segment.normal)
        nearest, gap = -1, FOUND_GATE_M
        for k in self._tracks:
            if (distance := math.dist((x, y), self._where(k, believed))) < gap:
                nearest, gap = k, distance
        if nearest < 0:
            self._founded += 1
            self._tracks[self._founded] = Track(x, y, now)
            return self._founded
        track = self._tracks[nearest]
        track.votes += 1
        track.last = now
        if track.votes <= VOTES_AVERAGED:
            track.x += (x - track.x) / track.votes
            track.y += (y - track.y) / track.votes
        if track.votes == RIPE_VOTES:
            begun[nearest] = (track.x, track.y)
        return nearest

    def _late(self, k: int) -> list[RangeHit]:
        """Give waiting ranges to a track that has just ripened."""
        if not self._waiting:
            return []
        track = self._tracks[k]
        sensors = np.array([reading.sensors[i] for reading, i in self._waiting])
        ranges = np.array([reading.ranges[i] for reading, i in self._waiting])
        longer, off, bearing = self._compare(sensors, ranges, np.array([[track.x, track.y]]))
        fits = (off[:, 0] <= BEAM_SLACK * self._half_angle) & (np.abs(longer[:, 0]) <= RANGE_GATE_FIRST_M)
        hits = []
        left: list[tuple[Reading, int]] = []
        for taken, (reading, i), direction in zip(fits.tolist(), self._waiting, bearing[:, 0].tolist(), strict=True):
            if taken:
                hits.append(self._hit(k, reading, i, direction))
            else:
                left.append((reading, i))
        self._waiting = deque(left, maxlen=WAITING)
        return hits

    def _associate(self, reading: Reading, believed: Mapping[int, Place]) -> list[RangeHit]:
        """Give each range to the track it fits best, and count what went through a track."""
        heard = np.isfinite(reading.ranges)
        ids = [k for k, track in self._tracks.items() if track.ripe]
        if not ids:
            self._waiting.extend((reading, i) for i in np.flatnonzero(heard).tolist())
            return []
        tracks = [self._tracks[k] for k in ids]
        places = np.array([self._where(k, believed) for k in ids])
        gates = np.array([RANGE_GATE_M if t.hits >= SETTLED_HITS else RANGE_GATE_FIRST_M for t in tracks])
        longer, off, bearing = self._compare(reading.sensors, reading.ranges, places)
        fits = (off <= BEAM_SLACK * self._half_angle) & (np.abs(longer) <= gates)
        best = np.argmin(np.where(fits, np.abs(longer), np.inf), axis=1)
        taken = fits.any(axis=1)
        hits = [
            self._hit(ids[j], reading, i, float(bearing[i, j]))
            for i, j in zip(np.flatnonzero(taken).tolist(), best[taken].tolist(), strict=True)
        ]
        self._waiting.extend((reading, i) for i in np.flatnonzero(heard & ~taken).tolist())
        through = (off <= BEAM_SURE * self._half_angle) & (longer > gates)
        for track, passed in zip(tracks, through.sum(axis=0).tolist(), strict=True):
            track.misses += passed
        return hits

    @staticmethod
    def _compare(sensors: Floats, ranges: Floats, places: Floats) -> tuple[Floats, Floats, Floats]:
        """Return for each sensor and place: range less the expected one, angle off the axis, bearing."""
        apart = places[None, :, :] - sensors[:, None, :2]
        expected = np.hypot(apart[..., 0], apart[..., 1]) - RADIUS_M
        bearing: NDArray[np.float64] = np.arctan2(apart[..., 1], apart[..., 0])
        off = np.abs((bearing - sensors[:, None, 2] + math.pi) % (2.0 * math.pi) - math.pi)
        return ranges[:, None] - expected, off, bearing

    def _hit(self, k: int, reading: Reading, i: int, bearing: float) -> RangeHit:
        track = self._tracks[k]
        track.hits += 1
        track.last = reading.number
        track.sectors.add(round(bearing / DRUM_SECTOR_RAD))
        x, y = float(reading.sensors[i, 0]), float(reading.sensors[i, 1])
        return RangeHit(k, reading.number, reading.ring, self._mounts[i], x, y, float(reading.ranges[i]))

    def _tidy(self, now: int, believed: Mapping[int, Place]) -> None:
        """Drop tracks that never ripened, and of two that lie on one another the one with less support."""
        stale = [k for k, t in self._tracks.items() if not t.ripe and now - t.last > FORGOTTEN_AFTER]
        for k in stale:
            del self._tracks[k]
        kept: list[Place] = []
        for k in sorted(self._tracks, key=lambda k: self._tracks[k].hits, reverse=True):
            here = self._where(k, believed)
            if self._tracks[k].ripe and any(math.dist(here, there) < 0.5 * FOUND_GATE_M for there in kept):
                del self._tracks[k]
            else:
                kept.append(here)
