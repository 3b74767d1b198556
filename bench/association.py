"""Data association for the peers, which their libraries leave to the user: gating, track management, confirmation.

All peers share it, and its time is measured apart from theirs. Centres that segments vote for create tracks. Each
range goes to the track that it fits best, within a gate around the estimator's estimate. Ranges that fit no track are
kept for a while, in case a new track explains them. A track is confirmed as a drum when enough ranges fit, few pulses
passed through it, and it was seen from enough directions. Tracks that converge on one place are merged.
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

NEW_TRACK_GATE_M: Final = 1.0 * FOOT_M
"""A vote farther than this from every track creates one; neighbouring drums are three feet apart."""
INITIAL_VOTES: Final = 4
VOTES_AVERAGED: Final = 30
RANGE_GATE_FIRST_M: Final = 0.35 * FOOT_M
RANGE_GATE_M: Final = 0.2 * FOOT_M
SETTLED_HITS: Final = 12
"""Ranges after which the narrower gate applies."""
BEAM_SLACK: Final = 1.15
"""Beam half-angles off the axis within which a range is accepted: the track's place is not exact yet."""
BEAM_INSIDE: Final = 0.85
"""Beam half-angles within which a track lies well inside the beam, so that a longer range passed through it."""
UNASSIGNED_MAX: Final = 240
"""Ranges without a track that are kept."""
DROPPED_AFTER: Final = 40
"""Readings without support after which an uninitialized track is dropped."""

DRUM_HITS: Final = 12
DRUM_HIT_SHARE: Final = 0.6
DRUM_SECTOR_RAD: Final = math.radians(5.0)
DRUM_SECTORS: Final = 12
"""Directions, five degrees wide each, from which a drum must be seen; passing by one gives twice as many."""


@dataclass(frozen=True, slots=True)
class RangeHit:
    """A range assigned to a track: the reading, the ring's pose (m, rad), the sensor's mount and place, m."""

    track: int
    reading: int
    ring: tuple[float, float, float]
    mount: Place
    x: float
    y: float
    range_m: float


@dataclass(frozen=True, slots=True)
class Evidence:
    """One reading after association."""

    initiated: Mapping[int, Place]
    """Tracks initialized by this reading, with a first estimate of the centre, m."""
    ranges: tuple[RangeHit, ...]
    segments: tuple[tuple[int, Segment], ...]
    confirmed: tuple[int, ...]
    """Tracks confirmed as drums, the best supported first."""


@dataclass(slots=True)
class Track:
    """Candidate for a drum: its place, m, and the evidence for it."""

    x: float
    y: float
    last: int
    votes: int = 1
    hits: int = 0
    misses: int = 0
    sectors: set[int] = field(default_factory=set)

    @property
    def is_initialized(self) -> bool:
        """Whether enough segments voted for a first estimate."""
        return self.votes >= INITIAL_VOTES

    @property
    def confirmed(self) -> bool:
        """Whether the evidence suffices for a drum."""
        enough = self.hits >= max(DRUM_HITS, DRUM_HIT_SHARE * (self.hits + self.misses))
        return self.is_initialized and enough and len(self.sectors) >= DRUM_SECTORS


class Association:
    """Associates readings with tracks.

    Parameters
    ----------
    ring
        Geometry of the sensors.
    """

    def __init__(self, ring: RingConfig) -> None:
        self._mounts = [(mount.x_m, mount.y_m) for mount in ring.mounts]
        self._half_angle = math.radians(ring.beam_half_angle_deg)
        self._tracks: dict[int, Track] = {}
        self._unassigned: deque[tuple[Reading, int]] = deque(maxlen=UNASSIGNED_MAX)
        self._created = 0

    def take(self, reading: Reading, estimates: Mapping[int, Place]) -> Evidence:
        """Return one reading's evidence, associated with tracks.

        Parameters
        ----------
        reading
            Reading of the whole ring.
        estimates
            Estimated centre of each track, m; the mean of the votes is used for tracks not in it.
        """
        self._prune(reading.number, estimates)
        initiated: dict[int, Place] = {}
        segments = tuple(
            (self._vote(segment, reading.number, estimates, initiated), segment) for segment in reading.segments
        )
        hits: list[RangeHit] = []
        for k in initiated:
            hits += self._assign_kept(k)
        hits += self._associate(reading, estimates)
        drums = sorted(((t.hits, k) for k, t in self._tracks.items() if t.confirmed), reverse=True)
        return Evidence(initiated, tuple(hits), segments, tuple(k for _, k in drums))

    def _where(self, k: int, estimates: Mapping[int, Place]) -> Place:
        track = self._tracks[k]
        return estimates.get(k, (track.x, track.y))

    def _vote(
        self, segment: Segment, number: int, estimates: Mapping[int, Place], initiated: dict[int, Place]
    ) -> int:
        """Assign a segment to the nearest track, or create one; return its key."""
        x = segment.ends[1][0] + RADIUS_M * math.cos(segment.normal)
        y = segment.ends[1][1] + RADIUS_M * math.sin(segment.normal)
        nearest, gap = -1, NEW_TRACK_GATE_M
        for k in self._tracks:
            if (distance := math.dist((x, y), self._where(k, estimates))) < gap:
                nearest, gap = k, distance
        if nearest < 0:
            self._created += 1
            self._tracks[self._created] = Track(x, y, number)
            return self._created
        track = self._tracks[nearest]
        track.votes += 1
        track.last = number
        if track.votes <= VOTES_AVERAGED:
            track.x += (x - track.x) / track.votes
            track.y += (y - track.y) / track.votes
        if track.votes == INITIAL_VOTES:
            initiated[nearest] = (track.x, track.y)
        return nearest

    def _assign_kept(self, k: int) -> list[RangeHit]:
        """Return the kept ranges that fit a track which has just been initialized."""
        if not self._unassigned:
            return []
        track = self._tracks[k]
        sensors = np.array([reading.sensors[i] for reading, i in self._unassigned])
        ranges = np.array([reading.ranges[i] for reading, i in self._unassigned])
        longer, off, bearing = self._compare(sensors, ranges, np.array([[track.x, track.y]]))
        fits = (off[:, 0] <= BEAM_SLACK * self._half_angle) & (np.abs(longer[:, 0]) <= RANGE_GATE_FIRST_M)
        hits = []
        left: list[tuple[Reading, int]] = []
        for taken, (reading, i), direction in zip(
            fits.tolist(), self._unassigned, bearing[:, 0].tolist(), strict=True
        ):
            if taken:
                hits.append(self._hit(k, reading, i, direction))
            else:
                left.append((reading, i))
        self._unassigned = deque(left, maxlen=UNASSIGNED_MAX)
        return hits

    def _associate(self, reading: Reading, estimates: Mapping[int, Place]) -> list[RangeHit]:
        """Return each range with the track it fits best, and count the pulses that passed through a track."""
        has_echo = np.isfinite(reading.ranges)
        ids = [k for k, track in self._tracks.items() if track.is_initialized]
        if not ids:
            self._unassigned.extend((reading, i) for i in np.flatnonzero(has_echo).tolist())
            return []
        tracks = [self._tracks[k] for k in ids]
        places = np.array([self._where(k, estimates) for k in ids])
        gates = np.array([RANGE_GATE_M if t.hits >= SETTLED_HITS else RANGE_GATE_FIRST_M for t in tracks])
        longer, off, bearing = self._compare(reading.sensors, reading.ranges, places)
        fits = (off <= BEAM_SLACK * self._half_angle) & (np.abs(longer) <= gates)
        best = np.argmin(np.where(fits, np.abs(longer), np.inf), axis=1)
        taken = fits.any(axis=1)
        hits = [
            self._hit(ids[j], reading, i, float(bearing[i, j]))
            for i, j in zip(np.flatnonzero(taken).tolist(), best[taken].tolist(), strict=True)
        ]
        self._unassigned.extend((reading, i) for i in np.flatnonzero(has_echo & ~taken).tolist())
        through = (off <= BEAM_INSIDE * self._half_angle) & (longer > gates)
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

    def _prune(self, number: int, estimates: Mapping[int, Place]) -> None:
        """Drop stale uninitialized tracks, and of two tracks in one place the one with less support."""
        stale = [k for k, t in self._tracks.items() if not t.is_initialized and number - t.last > DROPPED_AFTER]
        for k in stale:
            del self._tracks[k]
        kept: list[Place] = []
        for k in sorted(self._tracks, key=lambda k: self._tracks[k].hits, reverse=True):
            here = self._where(k, estimates)
            if self._tracks[k].is_initialized and any(
                math.dist(here, there) < 0.5 * NEW_TRACK_GATE_M for there in kept
            ):
                del self._tracks[k]
            else:
                kept.append(here)
