"""Objects that an operator places, moves, confirms or rejects, by the paper's method.

The paper's candidates come and go with clusters. What an operator placed, moved or confirmed is a candidate of its
own, a *placement*: it starts where it was put, the segments around it relax it like any other (§3.4), and it stays
until it is rejected. A rejection is kept by place: only segments that arrive after it can bring a candidate there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np

from config.settings import ITERATIONS_MAX, RelaxationConfig
from drivers.messages import wrap_angle
from perception.bounds import COUNT, FLAG, PLACE, bounds, index_of, up_to
from perception.kernel import Floats, Ints
from perception.object_model import ObjectModel
from perception.paper.outline_map import OutlineMap
from perception.paper.parameters import PLACEMENTS_MAX
from perception.relaxation import relax

PLACEMENT: Final = np.dtype(
    [
        ("pose", np.float64, 3),
        ("number", np.int64),
        ("model", np.int64),
        ("iterations_left", np.int64),
        ("is_confirmed", np.int64),
        ("members_sum", np.int64),
    ]
)
"""A placement: x, y (m), theta (rad); its object's number; index of its model; the iterations that it may still take,
0 at rest; 1 if the operator confirmed it; the sum of its segments' numbers, which changes with its segments."""

REJECTION: Final = np.dtype(
    [("x", np.float64), ("y", np.float64), ("reach", np.float64), ("model", np.int64), ("newest_segment", np.int64)]
)
"""A rejection: place and reach (m); index of the model; number of the newest segment at that time."""


@dataclass(slots=False)
class NumberSource:
    """Gives objects their numbers; none is given twice."""

    BOUNDS: ClassVar = bounds(last=COUNT)

    last: int = 0

    def next(self) -> int:
        """Return a number that was never given before."""
        self.last += 1
        return self.last


class Placements:
    """Models that an operator placed.

    Parameters
    ----------
    models : tuple of ObjectModel
        The models that can be placed.
    config : RelaxationConfig
        The paper's constants and the bound on the work.
    reach_m : float
        Segments up to half of this outside the model's outline attract it.
    """

    BOUNDS: Final = bounds(
        rows=lambda self: {
            "pose": PLACE,
            "number": COUNT,
            "model": index_of(len(self._models)),
            "iterations_left": up_to(ITERATIONS_MAX),
            "is_confirmed": FLAG,
            "members_sum": COUNT,
        },
        count=up_to(PLACEMENTS_MAX),
        _turn=COUNT,
    )

    def __init__(self, models: tuple[ObjectModel, ...], config: RelaxationConfig, reach_m: float) -> None:
        self.rows = np.zeros(PLACEMENTS_MAX, PLACEMENT)
        """(PLACEMENTS_MAX,): the placements; the first `count` are valid."""
        self.count = 0
        self._turn = 0
        self.apply_settings(models, config, reach_m)

    def apply_settings(self, models: tuple[ObjectModel, ...], config: RelaxationConfig, reach_m: float) -> None:
        """Use other settings; the present models come first in `models`.

        Parameters
        ----------
        models, config, reach_m
            As for the class.
        """
        self._models = models
        self._config = config
        self._reaches = tuple(float(np.hypot(*m.sides[:, :2].T).max()) + 0.5 * reach_m for m in models)

    @property
    def pending(self) -> bool:
        """Whether a placement is not at rest."""
        return self.count > 0 and bool(self.rows["iterations_left"][: self.count].any())

    def put(self, number: int, model: int, pose: tuple[float, float, float], *, confirmed: bool) -> None:
        """Place a model, or move the placement of this number; the caller has checked that there is room.

        Parameters
        ----------
        number : int
            The object's number.
        model : int
            Index of the model.
        pose : (float, float, float)
            m, rad.
        confirmed : bool
            Whether the operator confirmed the object.
        """
        k = self.find(number)
        if k is None:
            k = self.count
            self.count += 1
        self.rows[k] = (pose, number, model, self._config.iterations_max, confirmed, 0)

    def find(self, number: int) -> int | None:
        """Return the row of an object's placement, None if it has none."""
        found = np.flatnonzero(self.rows["number"][: self.count] == number)
        return int(found[0]) if len(found) else None

    def remove(self, k: int) -> None:
        """Remove a placement."""
        self.rows[k : self.count - 1] = self.rows[k + 1 : self.count].copy()
        self.count -= 1
        self.rows[self.count] = 0

    def clear(self) -> None:
        """Remove all placements."""
        self.rows[:] = 0
        self.count = 0

    def members(self, k: int, outline: OutlineMap) -> Ints:
        """Return the slots of the segments around placement `k`."""
        x, y, _ = self.rows["pose"][k]
        middles = 0.5 * (outline.segments[:, :2] + outline.segments[:, 2:4])
        off = np.hypot(middles[:, 0] - x, middles[:, 1] - y)
        return np.flatnonzero((outline.status > 0) & (off <= self._reaches[self.rows["model"][k]]))

    def restart_changed(self, outline: OutlineMap) -> None:
        """Relax those placements again whose segments have changed."""
        for k in range(self.count):
            members_sum = int(outline.numbers[self.members(k, outline)].sum())
            if members_sum != self.rows["members_sum"][k]:
                self.rows["members_sum"][k] = members_sum
                self.rows["iterations_left"][k] = self._config.iterations_max

    def restart_all(self) -> None:
        """Relax all placements again, as after a change of settings."""
        self.rows["iterations_left"][: self.count] = self._config.iterations_max

    def refine(self, outline: OutlineMap) -> int:
        """Relax one placement that is not at rest by one quantum; return the iterations done."""
        config, left = self._config, self.rows["iterations_left"]
        order = (self._turn + np.arange(self.count)) % max(1, self.count)
        k = int(next(k for k in order if left[k] > 0))
        self._turn = k + 1
        allowed = min(config.iterations_per_quantum, int(left[k]))
        done, rests = relax(
            self._models[self.rows["model"][k]].sides,
            outline.segments,
            self.members(k, outline),
            config.gamma,
            config.negligible_m,
            config.negligible_rad,
            allowed,
            self.rows["pose"][k],
        )
        left[k] = 0 if rests else left[k] - done
        return done


class Rejections:
    """Places where an operator rejected a model."""

    BOUNDS: Final = bounds(
        rows={"x": PLACE, "y": PLACE, "reach": PLACE, "model": COUNT, "newest_segment": COUNT}, total=COUNT
    )

    def __init__(self) -> None:
        self.rows = np.zeros(PLACEMENTS_MAX, REJECTION)
        """(PLACEMENTS_MAX,): the last rejections, a ring buffer."""
        self.total = 0
        """Rejections so far."""

    def add(self, x: float, y: float, reach_m: float, model: int, newest_segment: int) -> None:
        """Add a rejection; the oldest is overwritten.

        Parameters
        ----------
        x, y, reach_m : float
            The place, and how far around it the rejection applies, m.
        model : int
            Index of the model.
        newest_segment : int
            Number of the newest segment in the map.
        """
        self.rows[self.total % PLACEMENTS_MAX] = (x, y, reach_m, model, newest_segment)
        self.total += 1

    def newest_excluded(self, x: float, y: float, model: int) -> int:
        """Return the newest segment that does not count for a model at (x, y), m; 0 if all segments count.

        Parameters
        ----------
        x, y : float
            Position of the model in the odometry's frame, m.
        model : int
            Index of the model.
        """
        newest = 0
        for row in self.rows[: min(self.total, PLACEMENTS_MAX)]:
            if row["model"] == model and math.hypot(row["x"] - x, row["y"] - y) < row["reach"]:
                newest = max(newest, int(row["newest_segment"]))
        return newest

    def clear(self) -> None:
        """Remove all rejections."""
        self.rows[:] = 0
        self.total = 0


def wrapped_pose(pose: Floats) -> tuple[float, float, float]:
    """Return a pose (m, rad) with its heading wrapped into [−π, π)."""
    x, y, theta = (float(v) for v in pose)
    return x, y, wrap_angle(theta)
