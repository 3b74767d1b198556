"""Perception as an anytime stage: the part that always runs, and refinement in quanta of bounded work.

`observe` takes in one firing. `refine` does one quantum; the caller decides how many it can afford, and what is
unfinished goes on next time from where it stood. How objects are recognised is a method's affair: the paper's, or the
full one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from config.model import ModelConfig
from config.robot import RingConfig
from config.settings import PerceptionConfig
from drivers.messages import Firing
from perception.bayes.bayes_method import BayesPerception
from perception.edits import Edit, Evidence, MoveObject, PlaceModel, Segments, not_a_number, out_of_place
from perception.fresh_echoes import FreshEchoes
from perception.kernel import Floats
from perception.paper.paper_method import PaperPerception
from perception.seen_object import SeenObject, Tally
from perception.segments import mounts_array
from perception.sensor_monitor import SensorWatch
from perception.sensor_report import SensorReport
from perception.snapshot import Snapshot, put_back, snapshot_of

__all__ = ["Method", "Perception", "SeenObject", "method_of"]


class Method(Protocol):
    """A way to recognise objects."""

    @property
    def pending(self) -> bool:
        """Whether refinement has anything left to improve now."""
        ...

    @property
    def waiting(self) -> bool:
        """Whether anything may wait for refinement, be it for the next firing."""
        ...

    @property
    def tally(self) -> Tally:
        """How many segments and hypotheses there are."""
        ...

    def observe(self, firing: Firing) -> int:
        """Take in one firing and return how many outline segments it completed."""
        ...

    def refine(self) -> int:
        """Do one quantum of refinement and return its iterations, zero where nothing is left to improve."""
        ...

    def objects(self) -> tuple[SeenObject, ...]:
        """Return the models recognised now, best first."""
        ...

    def things(self) -> tuple[SeenObject, ...]:
        """Return everything that has a name, models or not."""
        ...

    def segments_now(self) -> Floats:
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

    def forget(self) -> None:
        """Begin anew, as after the odometry did."""
        ...

    def adopt(self, config: PerceptionConfig) -> None:
        """Go on with other constants, of those that a running process follows (`config.reload.LIVE`)."""
        ...

    def recognise(self, models: Sequence[ModelConfig]) -> None:
        """Look for further models as well, which come after those from before."""
        ...

    def restored(self) -> None:
        """Drop what was worked out before the memory was put back from a snapshot."""
        ...


def method_of(ring: RingConfig, models: Sequence[ModelConfig], config: PerceptionConfig) -> Method:
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
        self.method = method_of(ring, models, config)
        self.watch = SensorWatch(ring)
        self._echoes = FreshEchoes(mounts_array(ring.mounts))
        self._sensors = len(ring.mounts)
        self._models = tuple(models)

    @property
    def pending(self) -> bool:
        """Whether refinement has anything left to improve now."""
        return self.method.pending

    @property
    def waiting(self) -> bool:
        """Whether anything may wait for refinement, be it for the next firing."""
        return self.method.waiting

    @property
    def tally(self) -> Tally:
        """How many segments and hypotheses there are."""
        return self.method.tally

    def observe(self, firing: Firing) -> int:
        """Take in one firing and return how many outline segments it completed.

        Raises
        ------
        ValueError
            The firing is not this ring's; compiled code would read beyond its arrays.
        """
        if len(firing.ranges_m) != self._sensors:
            raise ValueError(f"a firing of {len(firing.ranges_m)} ranges came to a ring of {self._sensors} sensors")
        believed, possible = self.watch.believe(firing)
        self._echoes.update(possible)
        return self.method.observe(believed)

    def refine(self) -> int:
        """Do one quantum of refinement and return its iterations, zero where nothing is left to improve."""
        return self.method.refine()

    def objects(self) -> tuple[SeenObject, ...]:
        """Return the models recognised now, best first."""
        return self.method.objects()

    def things(self) -> tuple[SeenObject, ...]:
        """Return everything that has a name, models or not: also walls, corners, posts and what is unknown."""
        return self.method.things()

    def segments_now(self) -> Floats:
        """Return the outline segments in the map: ends x, y, x, y (m) and normal (rad), shape (n, 5), a copy."""
        return self.method.segments_now()

    def segments(self) -> Segments:
        """Return the outline segments in the map with their numbers, times, and which are pinned; copies."""
        return self.method.segments()

    def edit(self, edit: Edit) -> str | None:
        """Do what a person says; return None, or why it cannot be done, in words for that person.

        What the robot has to keep clear of is none of a person's affair: the fresh echoes stay whatever is edited.
        """
        refused = not_a_number(edit)
        if refused is None and isinstance(edit, PlaceModel | MoveObject):
            refused = out_of_place(edit.x, edit.y, edit.theta)
        return self.method.edit(edit) if refused is None else refused

    def evidence(self, number: int) -> Evidence | None:
        """Return why an object is believed, None where there is none of this number; changes nothing."""
        return self.method.evidence(number)

    def obstacles(self, t_s: float, age_max_s: float) -> Floats:
        """Return each sensor's last echo not older than that at the robot's time `t_s`: points of shape (k, 2), m."""
        return self._echoes.points(t_s, age_max_s)

    def forget(self) -> None:
        """Begin anew, as after the odometry did."""
        self.method.forget()
        self.watch.forget()
        self._echoes.clear()

    def adopt(self, config: PerceptionConfig) -> None:
        """Go on with other constants, of those that a running process follows (`config.reload.LIVE`)."""
        self.method.adopt(config)

    def recognise(self, models: Sequence[ModelConfig]) -> None:
        """Look for these models from now on: those from before, and perhaps further ones after them."""
        if tuple(models) != self._models:
            self._models = tuple(models)
            self.method.recognise(models)

    def listen_to(self, ring: RingConfig) -> None:
        """Expect another firing pattern of the same sensors from now on."""
        self.watch.listen_to(ring)

    def sensors(self) -> tuple[SensorReport, ...]:
        """Return which sensors are not believed, and why."""
        return self.watch.reports()

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
        self.method.restored()
