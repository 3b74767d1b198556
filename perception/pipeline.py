"""Perception as an anytime stage: the part that always runs, and refinement in quanta of bounded work.

`observe` takes in one firing. `refine` does one quantum; the caller decides how many it can afford, and what is
unfinished goes on next time from where it stood. Objects are recognised by a method: the paper's or the Bayesian one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from config.model import ModelConfig
from config.robot import RingConfig
from config.settings import PerceptionConfig
from drivers.messages import Firing
from perception.bayes.bayes_method import BayesPerception
from perception.detected_object import DetectedObject, MapCounts
from perception.edits import Edit, Evidence, MoveObject, PlaceModel, Segments, invalid_number, invalid_pose
from perception.fresh_echoes import FreshEchoes
from perception.kernel import Floats
from perception.paper.paper_method import PaperPerception
from perception.sensor_monitor import SensorMonitor
from perception.sensor_mounts import mounts_array
from perception.sensor_report import SensorReport
from perception.snapshot import Snapshot, put_back, snapshot_of

__all__ = ["DetectedObject", "Method", "Perception", "make_method"]


class Method(Protocol):
    """A way to recognise objects."""

    @property
    def can_refine(self) -> bool:
        """Whether `refine` has anything to improve now."""
        ...

    @property
    def converged(self) -> bool:
        """Whether nothing is left to improve, now or with the next firing."""
        ...

    @property
    def counts(self) -> MapCounts:
        """How many segments and hypotheses there are."""
        ...

    def observe(self, firing: Firing) -> int:
        """Take in one firing and return how many outline segments it completed."""
        ...

    def refine(self) -> int:
        """Do one quantum of refinement and return its iterations, zero where nothing is left to improve."""
        ...

    def objects(self) -> tuple[DetectedObject, ...]:
        """Return the models recognised now, best first."""
        ...

    def labelled_objects(self) -> tuple[DetectedObject, ...]:
        """Return everything that has a name, models or not."""
        ...

    def segment_geometry(self) -> Floats:
        """Return the outline segments in the map: ends x, y, x, y (m) and normal (rad), shape (n, 5), a copy."""
        ...

    def segments(self) -> Segments:
        """Return the outline segments in the map with all that is known of them."""
        ...

    def edit(self, edit: Edit) -> str | None:
        """Do what a person says; return None, or why it cannot be done."""
        ...

    def evidence(self, number: int) -> Evidence | None:
        """Return why an object is believed, None where there is none of this number; changes nothing."""
        ...

    def reset(self) -> None:
        """Begin anew, as after the odometry did."""
        ...

    def apply_settings(self, config: PerceptionConfig) -> None:
        """Go on with other constants, of those that a running process follows (`config.reload.LIVE_SETTINGS`)."""
        ...

    def set_models(self, models: Sequence[ModelConfig]) -> None:
        """Look for further models as well, which come after those from before."""
        ...

    def drop_caches(self) -> None:
        """Drop what was worked out before the memory was put back from a snapshot."""
        ...


def make_method(ring: RingConfig, models: Sequence[ModelConfig], config: PerceptionConfig) -> Method:
    """Return the method that the configuration names."""
    if config.method == "paper":
        return PaperPerception(ring, models, config)
    return BayesPerception(ring, models, config.bayes)


class Perception:
    """Echoes to objects and obstacles.

    Parameters
    ----------
    ring : RingConfig
        The sensors.
    models : sequence of ModelConfig
        What is looked for.
    config : PerceptionConfig
        The method and its constants.
    """

    def __init__(self, ring: RingConfig, models: Sequence[ModelConfig], config: PerceptionConfig) -> None:
        self.method = make_method(ring, models, config)
        self.sensor_monitor = SensorMonitor(ring)
        self._echoes = FreshEchoes(mounts_array(ring.mounts))
        self._sensors = len(ring.mounts)
        self._models = tuple(models)

    @property
    def can_refine(self) -> bool:
        """Whether `refine` has anything to improve now."""
        return self.method.can_refine

    @property
    def converged(self) -> bool:
        """Whether nothing is left to improve, now or with the next firing."""
        return self.method.converged

    @property
    def counts(self) -> MapCounts:
        """How many segments and hypotheses there are."""
        return self.method.counts

    def observe(self, firing: Firing) -> int:
        """Take in one firing and return how many outline segments it completed.

        Raises
        ------
        ValueError
            The firing is not this ring's; compiled code would read beyond its arrays.
        """
        if len(firing.ranges_m) != self._sensors:
            raise ValueError(f"a firing of {len(firing.ranges_m)} ranges came to a ring of {self._sensors} sensors")
        believed, possible = self.sensor_monitor.filter(firing)
        self._echoes.update(possible)
        return self.method.observe(believed)

    def refine(self) -> int:
        """Do one quantum of refinement and return its iterations, zero where nothing is left to improve."""
        return self.method.refine()

    def objects(self) -> tuple[DetectedObject, ...]:
        """Return the models recognised now, best first."""
        return self.method.objects()

    def labelled_objects(self) -> tuple[DetectedObject, ...]:
        """Return everything that has a name, models or not: also walls, corners, posts and what is unknown."""
        return self.method.labelled_objects()

    def segment_geometry(self) -> Floats:
        """Return the outline segments in the map: ends x, y, x, y (m) and normal (rad), shape (n, 5), a copy."""
        return self.method.segment_geometry()

    def segments(self) -> Segments:
        """Return the outline segments in the map with their numbers, times, and which are pinned; copies."""
        return self.method.segments()

    def edit(self, edit: Edit) -> str | None:
        """Do what a person says; return None, or why it cannot be done, in words for that person.

        What the robot has to keep clear of is none of a person's affair: the fresh echoes stay whatever is edited.
        """
        refused = invalid_number(edit)
        if refused is None and isinstance(edit, PlaceModel | MoveObject):
            refused = invalid_pose(edit.x, edit.y, edit.theta)
        return self.method.edit(edit) if refused is None else refused

    def evidence(self, number: int) -> Evidence | None:
        """Return why an object is believed, None where there is none of this number; changes nothing."""
        return self.method.evidence(number)

    def obstacles(self, t_s: float, age_max_s: float) -> Floats:
        """Return each sensor's last echo not older than that at the robot's time `t_s`: points of shape (k, 2), m."""
        return self._echoes.points(t_s, age_max_s)

    def reset(self) -> None:
        """Begin anew, as after the odometry did."""
        self.method.reset()
        self.sensor_monitor.reset()
        self._echoes.clear()

    def apply_settings(self, config: PerceptionConfig) -> None:
        """Go on with other constants, of those that a running process follows (`config.reload.LIVE_SETTINGS`)."""
        self.method.apply_settings(config)

    def set_models(self, models: Sequence[ModelConfig]) -> None:
        """Look for these models from now on: those from before, and perhaps further ones after them."""
        if tuple(models) != self._models:
            self._models = tuple(models)
            self.method.set_models(models)

    def set_firing_pattern(self, ring: RingConfig) -> None:
        """Expect another firing pattern of the same sensors from now on."""
        self.sensor_monitor.set_firing_pattern(ring)

    def sensor_reports(self) -> tuple[SensorReport, ...]:
        """Return which sensors are not believed, and why."""
        return self.sensor_monitor.reports()

    def snapshot(self) -> Snapshot:
        """Return copies of everything remembered, from which `restore` goes on to the bit."""
        return snapshot_of(self)

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from a snapshot that perception of the same settings gave.

        Raises
        ------
        ValueError
            The snapshot is of other settings.
        """
        put_back(self, snapshot)
        self.method.drop_caches()
