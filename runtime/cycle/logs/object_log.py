"""What the log says about the map: each object that was sure and no longer is, with the reason."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

import numpy as np

from behaviors.no_go import side_distances_m
from drivers.token_bucket import LineLimit
from perception.detected_object import DetectedObject
from perception.pipeline import Perception

if TYPE_CHECKING:
    from structlog.typing import FilteringBoundLogger

LOOK_S: Final = 10.0
"""Time between two looks at the map, s: a look takes as long as a frame of the console."""
LINES_PER_S: Final = 0.1
LINES_BURST: Final = 20.0
SURE: Final = 0.99
NEAR_M: Final = 0.3
"""Objects nearer to each other stand in one place."""
NO_EVIDENCE: Final = (
    "its readings no longer support it: newer ones went through its place, or other objects explain them better"
)


def why_gone(gone: DetectedObject, now: Sequence[DetectedObject]) -> str:
    """Return why an object that was sure is not, as text.

    `gone` is as it was while it was sure; `now` are all objects, those left behind included.
    """
    for one in now:
        if one.number == gone.number:
            what = "" if one.model == gone.model else f"it is more likely: {one.model}; "
            return f"{what}new readings changed its probability to {one.probability or 0.0:.0%}"
    for one in now:
        if one.number is not None and one.model == gone.model and _is_at(one, gone):
            return f"it became part of {one.model} {one.number}"
    for one in now:
        if one.number is not None and (one.probability or 0.0) > SURE and _is_at(one, gone):
            return f"{one.model} {one.number} explains its readings better"
    return NO_EVIDENCE


def _is_at(one: DetectedObject, gone: DetectedObject) -> bool:
    """Return whether an object stands in the place of another one."""
    if one.ends is None:
        return math.dist((one.x, one.y), (gone.x, gone.y)) < NEAR_M
    return float(side_distances_m(np.array([one.ends]), np.array((gone.x, gone.y)))[0]) < NEAR_M


class ObjectLog:
    """Logs why objects that were sure are gone, at a bounded rate."""

    def __init__(self, log: FilteringBoundLogger) -> None:
        self._log = log
        self._limit = LineLimit(LINES_PER_S, LINES_BURST)
        self._sure: Mapping[int, DetectedObject] = MappingProxyType({})
        self._due_s = 0.0

    def observe(self, perception: Perception, run_s: float, *, is_edited: bool) -> None:
        """Look at the map if that is due; what goes with an operator's edit of the map is not logged."""
        if is_edited:
            self._sure, self._due_s = MappingProxyType({}), run_s
        if 0.0 <= self._due_s - run_s <= LOOK_S:
            return
        self._due_s = run_s + LOOK_S
        now = (*perception.labelled_objects(), *perception.archived_objects())
        sure = {one.number: one for one in now if one.number is not None and _is_sure(one)}
        for number, one in self._sure.items():
            if number not in sure or sure[number].model != one.model:
                left_out = self._limit.take(run_s)
                if left_out is not None:
                    more = {"suppressed_before": left_out} if left_out else {}
                    self._log.info("object gone", object=_named(one), reason=why_gone(one, now), **more)
        self._sure = sure


def _is_sure(one: DetectedObject) -> bool:
    """Return whether an object is as good as certain, or an operator confirmed it."""
    return one.model != "unknown" and ((one.probability or 0.0) > SURE or one.confirmed)


def _named(one: DetectedObject) -> str:
    """Return an object's kind, number and place as text."""
    size = ""
    if one.ends is not None:
        size = f", {math.dist(one.ends[:2], one.ends[2:]):.1f} m long"
    return f"{one.model} {one.number} at ({one.x:.2f}, {one.y:.2f}) m{size}"
