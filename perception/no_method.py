"""What stands in for a method whose kernels are not compiled or loaded yet."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from config.model import ModelConfig
from config.settings import PerceptionConfig
from drivers.messages import Firing, Floats
from perception.detected_object import DetectedObject, MapCounts
from perception.edits import Evidence, MapEdit, Segments
from perception.map_moves import MapMoves

NOT_READY: Final = "recognition is not ready yet: wait until it is"
NOTHING: Final = MapCounts(segments=0, segments_total=0, hypotheses=0)


class NoMethod:
    """The method in place of one whose kernels are not ready: an empty map that refuses every edit."""

    can_refine = False
    converged = True
    counts = NOTHING

    def observe(self, _firing: Firing) -> int:
        """Return 0: no segment was completed."""
        return 0

    def refine(self) -> int:
        """Return 0: nothing was improved."""
        return 0

    def objects(self) -> tuple[DetectedObject, ...]:
        """Return no objects."""
        return ()

    near_objects = labelled_objects = archived_objects = objects

    def segment_geometry(self) -> Floats:
        """Return no segments, shape (0, 5)."""
        return np.zeros((0, 5))

    def segments(self) -> Segments:
        """Return no segments."""
        numbers = np.zeros(0, np.int64)
        return Segments(numbers, self.segment_geometry(), np.zeros(0), numbers)

    def edit(self, _edit: MapEdit) -> str | None:
        """Return why no edit is possible."""
        return NOT_READY

    def kept(self, _number: int) -> str | None:
        """Return None: there are no objects."""
        return None

    def kept_walls(self) -> str:
        """Return the empty text: there are no walls."""
        return ""

    def evidence(self, _number: int) -> Evidence | None:
        """Return None: there are no objects."""
        return None

    def locate_echoes(self, _bearings: Floats) -> int:
        """Write nothing and return 0: there are no objects."""
        return 0

    def shift_object(self, number: int, dx: float, dy: float) -> None:
        """Move nothing: there are no objects."""

    def follow_maps(self, submap: int, moves: MapMoves | None) -> None:
        """Move nothing, likewise."""

    def reset(self) -> None:
        """Leave the empty map as it is."""

    def apply_settings(self, config: PerceptionConfig) -> None:
        """Ignore the settings: the method itself begins with those in force."""

    def set_models(self, models: Sequence[ModelConfig]) -> None:
        """Ignore the models, likewise."""

    def drop_caches(self) -> None:
        """Do nothing: there are none."""
