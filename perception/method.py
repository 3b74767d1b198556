"""What perception asks of a method that recognises objects, and the methods there are."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from config.model import ModelConfig
from config.robot import RingConfig
from config.settings import PerceptionConfig
from drivers.messages import Firing
from perception.detected_object import DetectedObject, MapCounts
from perception.edits import Evidence, MapEdit, Segments
from perception.kernel import Floats
from perception.map_moves import MapMoves


class Method(Protocol):
    """A method of recognising objects."""

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
        """The numbers of segments and hypotheses."""
        ...

    def observe(self, firing: Firing) -> int:
        """Enter one firing and return how many outline segments it completed."""
        ...

    def refine(self) -> int:
        """Do one quantum of refinement and return its iterations, zero if nothing is left to improve."""
        ...

    def objects(self) -> tuple[DetectedObject, ...]:
        """Return the models recognised so far: those near the robot, best first, then those left behind."""
        ...

    def near_objects(self) -> tuple[DetectedObject, ...]:
        """Return the models recognised near the robot, best first; the cost does not depend on the map's size."""
        ...

    def labelled_objects(self) -> tuple[DetectedObject, ...]:
        """Return the models recognised near the robot and everything else there that has a label."""
        ...

    def archived_objects(self) -> tuple[DetectedObject, ...]:
        """Return what has a label and was left behind; the same tuple until it changes."""
        ...

    def locate_echoes(self, bearings: Floats) -> int:
        """Write where in its beam each echo of the last firing came from; return what is known of slanting walls.

        That is −1 if they do not answer, as mirrors, 1 if they do, and 0 if it is not known.

        Parameters
        ----------
        bearings : (n,) float
            By sensor, rad from its axis, counter-clockwise; NaN where nothing that is sure explains the echo. That of
            a sensor that heard the same as before, from the same place, stays. Updated.
        """
        ...

    def segment_geometry(self) -> Floats:
        """Return a copy of the outline segments: end points x1, y1, x2, y2 (m) and normal (rad), shape (n, 5)."""
        ...

    def segments(self) -> Segments:
        """Return the outline segments with their numbers, times and pins."""
        ...

    def edit(self, edit: MapEdit) -> str | None:
        """Apply an operator's edit; return None, or why it cannot be applied."""
        ...

    def kept(self, number: int) -> str | None:
        """Return what is kept of an object as text, from which `edits.RestoreObjects` makes it again.

        None if no object has this number, or if nothing but readings makes it, as for a wall.
        """
        ...

    def kept_walls(self) -> str:
        """Return what is kept of walls and corners as text, for `edits.RestoreObjects`; empty without any."""
        ...

    def evidence(self, number: int) -> Evidence | None:
        """Return the evidence for an object, None if no object has this number; changes nothing."""
        ...

    def shift_object(self, number: int, dx: float, dy: float) -> None:
        """Move an object and what is kept for it by a vector (m), after its place in the map was corrected."""
        ...

    def follow_maps(self, submap: int, moves: MapMoves | None) -> None:
        """Continue in the map of the way with this number; move what was left behind with its map, if any moved."""
        ...

    def reset(self) -> None:
        """Start again with an empty map, as after a reset of the odometry."""
        ...

    def apply_settings(self, config: PerceptionConfig) -> None:
        """Use other settings, of those that a running process may change (`config.reload.LIVE_SETTINGS`)."""
        ...

    def set_models(self, models: Sequence[ModelConfig]) -> None:
        """Recognise further models, which follow the present ones in `models`."""
        ...

    def drop_caches(self) -> None:
        """Discard cached results, after the memory was restored from a snapshot."""
        ...


def make_method(ring: RingConfig, models: Sequence[ModelConfig], config: PerceptionConfig) -> Method:
    """Return the method that the settings name.

    Parameters
    ----------
    ring : RingConfig
        The sensors.
    models : sequence of ModelConfig
        The objects to recognise.
    config : PerceptionConfig
        The method and its settings.
    """
    if config.method == "paper":
        from perception.paper.paper_method import PaperPerception

        return PaperPerception(ring, models, config)
    from perception.bayes.bayes_method import BayesPerception

    return BayesPerception(ring, models, config.bayes)
