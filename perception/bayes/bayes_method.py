"""The Bayesian method behind perception's door: firings in, objects out.

What is remembered and what is done with it is in the kernels; here is when they are called. Each call does a bounded
piece of work: a firing a bounded number of quanta, a quantum one object.
"""

from __future__ import annotations

from collections.abc import Sequence
from operator import attrgetter
from typing import Final

import numpy as np

from config.model import ModelConfig
from config.robot import RingConfig
from config.settings import BayesConfig, PerceptionConfig
from drivers.messages import Firing
from perception.bayes.entry import hold, observe, pquantum, quantum, sure_circles
from perception.bayes.evidence import evidence_of
from perception.bayes.kernel_settings import circle_models, library, make_settings, tuned
from perception.bayes.map_edits import edit_memory, row_of
from perception.bayes.object_report import (
    POLYGON_PROBABILITY,
    TOLD,
    circle,
    other_things,
    polygon,
    rival_label,
    rival_labels,
    sure_polygons,
)
from perception.bayes.pinned_segments import Pins
from perception.bayes.segment_list import drawn, listed
from perception.bayes.state import KIND, MODEL, PPROB, PROB, PT, SEGMENTS, ST, clear, make_state
from perception.bayes.state_migration import inherit, number_heirs
from perception.detected_object import DetectedObject, MapCounts
from perception.edits import Edit, Evidence, Segments
from perception.kernel import Floats
from perception.sensor_mounts import mounts_array


class BayesPerception:
    """Echoes to objects, by raw ranges and all explanations at once.

    Parameters
    ----------
    ring : RingConfig
        The sensors.
    models : sequence of ModelConfig
        What is looked for: circles by their radius, open and closed polygons by their outline.
    config : BayesConfig
        What a user may set.
    """

    SCRATCH: Final = ("_sure", "_told", "_handle")
    """No memory: what reporting works with, and another way to the memory."""
    LATER: Final = ("_pins", "memory.names", "memory.tally", "memory.stamps", "memory.barred")
    """What recordings of older programs do not hold."""

    def __init__(self, ring: RingConfig, models: Sequence[ModelConfig], config: BayesConfig) -> None:
        self._mounts = mounts_array(ring.mounts)
        self._config = config
        self.settings = make_settings(ring, models, config)
        """What kernels are told."""
        self.memory = make_state(len(self._mounts), self.settings, config.tracks_max)
        """What they remember."""
        self._handle = hold(self.memory, self.settings)
        self._pins = Pins()
        self._library(models)
        self._sure = np.zeros(max(config.tracks_max, PT), np.int64)
        self._told = np.full((config.tracks_max, TOLD), np.nan)
        self._circles: dict[int, DetectedObject] = {}
        self._objects: tuple[DetectedObject, ...] | None = None
        self._left = 0
        self._polygons_left = 0
        self._circles_pending = False
        self._polygons_pending = False
        self._polygons_turn = False

    @property
    def can_refine(self) -> bool:
        """Whether `refine` has anything to improve before the next firing."""
        return (self._circles_pending and self._left > 0) or (self._polygons_pending and self._polygons_left > 0)

    @property
    def converged(self) -> bool:
        """Whether nothing is left to improve, now or with the next firing."""
        return not (self._circles_pending or self._polygons_pending)

    @property
    def counts(self) -> MapCounts:
        """How many segments and tracks there are, the latter established or not."""
        s = self.memory
        living = np.minimum(s.fill, s.store.shape[1]).sum()
        tracks = np.count_nonzero(s.ti[:, ST]) + np.count_nonzero(s.pi[:, ST])
        return MapCounts(int(living), int(s.g[SEGMENTS]), int(tracks))

    def observe(self, firing: Firing) -> int:
        """Take in one firing and return how many outline segments it completed."""
        pose = firing.pose
        made, self._circles_pending = observe(
            self._handle, self._mounts, float(pose.x), float(pose.y), float(firing.ring_yaw), float(firing.robot_s),
            firing.ranges_m, self._config.fresh_share,
        )  # fmt: skip
        # Polygons come after the circles, but not where the time was up before it was their turn.
        self._polygons_turn = self._polygons_pending and self._polygons_left > 0 and not self._polygons_turn
        self._left = self._config.quanta_per_firing
        self._polygons_left = self._config.polygon_quanta_per_firing
        self._polygons_pending = self.settings.polys > 0
        if self._pins.count > 0:
            self._pins.renew(self.memory)
        return made

    def refine(self) -> int:
        """Refine one object; return 1, or 0 where nothing is left to improve."""
        polygons = self._polygons_pending and self._polygons_left > 0
        if self._circles_pending and self._left > 0 and not (polygons and self._polygons_turn):
            self._left -= 1
            self._objects = None
            self._circles_pending = quantum(self._handle, self._config.fresh_share)
            return 1
        if polygons:
            self._polygons_left -= 1
            self._objects = None
            self._polygons_pending = pquantum(self._handle, self._config.fresh_share)
            return int(self._polygons_pending)
        return 0

    def objects(self) -> tuple[DetectedObject, ...]:
        """Return the models that are sure, best first; only refinement changes them."""
        if self._objects is None:
            self._objects = self._sure_objects()
        return self._objects

    def _sure_objects(self) -> tuple[DetectedObject, ...]:
        s, p = self.memory, self.settings
        least = self._config.report_probability
        n = sure_circles(self._handle, self._told, self._sure)
        seen = [self._circles[t] if t >= 0 else self._tell_circle(~t) for t in self._sure[:n].tolist()]
        if p.polys > 0:
            least = min(least, POLYGON_PROBABILITY)
            n = sure_polygons(s.pi, s.pf, s.pbn, s.pbins, s.names, len(s.ti), least, self._sure)
            seen += [
                polygon(s, p, t, self._outlines[s.pi[t, MODEL]], float(s.pf[t, PPROB]))
                for t in self._sure[:n].tolist()
            ]
        return tuple(sorted(seen, key=attrgetter("score"), reverse=True))

    def _tell_circle(self, t: int) -> DetectedObject:
        s = self.memory
        told = circle(s, self.settings, t, self._round[s.ti[t, KIND]], float(s.tf[t, PROB]))
        self._circles[t] = told
        return told

    def labelled_objects(self) -> tuple[DetectedObject, ...]:
        """Return the objects, then everything else that has a name."""
        called = self.objects()
        return (*called, *other_things(self.memory, self.settings, self._config.report_probability, called))

    def segment_geometry(self) -> Floats:
        """Return the mapped segments: ends x, y, x, y (m) and normal (rad), shape (n, 5), a copy."""
        return drawn(listed(self.memory)[2])

    def segments(self) -> Segments:
        """Return the outline segments in the map with all that is known of them."""
        numbers, times, rows = listed(self.memory)
        pinned = np.isin(numbers, self._pins.numbers.astype(np.int64)) if self._pins.count else np.zeros(len(numbers))
        return Segments(numbers, drawn(rows), times, pinned.astype(np.int64))

    def edit(self, edit: Edit) -> str | None:
        """Do what a person says; return None, or why it cannot be done."""
        self._objects = None
        return edit_memory(self.memory, self.settings, self._pins, self._round, self._outlines, edit)

    def evidence(self, number: int) -> Evidence | None:
        """Return what each reading that an object has kept says of it."""
        s, p = self.memory, self.settings
        row = row_of(s, number)
        if row is None:
            return None
        if row >= len(s.ti):
            name = self._outlines[s.pi[row - len(s.ti), MODEL]]
        else:
            name = self._round[s.ti[row, KIND]] if s.ti[row, KIND] < p.models else rival_label(s, row)
        return evidence_of(s, p, row, number, name, rival_labels(p, self._round))

    def reset(self) -> None:
        """Begin anew, as after the odometry did."""
        clear(self.memory)
        self._pins.clear()
        self._objects = ()
        self._left = 0
        self._polygons_left = 0
        self._circles_pending = self._polygons_pending = self._polygons_turn = False

    def apply_settings(self, config: PerceptionConfig) -> None:
        """Go on with other constants; the number of tracks stays."""
        self._config = config.bayes
        self.settings = tuned(self.settings, config.bayes)
        self._handle = hold(self.memory, self.settings)
        self._objects = None

    def set_models(self, models: Sequence[ModelConfig]) -> None:
        """Look for further models as well, which come after those from before."""
        before, self.settings = self.settings, self.settings._replace(**library(models))
        self.memory = inherit(self.memory, before, self.settings)
        self._handle = hold(self.memory, self.settings)
        self._library(models)
        self._told[:] = np.nan
        self._objects = None

    def drop_caches(self) -> None:
        """Drop what was worked out before the memory was put back from a snapshot, and make good what it lacks."""
        number_heirs(self.memory)
        self._told[:] = np.nan
        self._objects = None

    def _library(self, models: Sequence[ModelConfig]) -> None:
        _, self._round = circle_models(models)
        self._outlines = [m.name for m in models if m.arc_radius_m is None]
