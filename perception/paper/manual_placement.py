"""What an operator says stands somewhere, or does not, by the paper's method.

The paper's candidates come from clusters and go with them. What was placed, moved or confirmed by hand is a candidate
of its own, a *placement*: it starts where it was put, the segments around it relax it as they do any other (§3.4),
and it stays until it is rejected. A rejection is kept by place: what rests there is judged by the segments that came
after it alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from config.settings import RelaxationConfig
from perception.kernel import Floats, Ints
from perception.object_model import ObjectModel
from perception.paper.outline_map import OutlineMap
from perception.relaxation import relax

ROOM: Final = 32
"""Placements, and rejections, at a time."""
NUMBER, MODEL, LEFT, CONFIRMED, HEARD = range(5)
"""Columns of a placement: its object's number, its model, iterations it may still take, whether it was confirmed, and
the sum of its segments' numbers: another sum is other segments."""


@dataclass(slots=False)
class Names:
    """Gives objects their numbers; none twice."""

    last: int = 0

    def next(self) -> int:
        """Return a number that nothing has had yet."""
        self.last += 1
        return self.last


class Placements:
    """Models that a person put somewhere.

    Parameters
    ----------
    models : tuple of ObjectModel
        What can be placed.
    config : RelaxationConfig
        The paper's constants and the bound on the work.
    reach_m : float
        Segments as far as half of this outside the model's outline pull at it.
    """

    def __init__(self, models: tuple[ObjectModel, ...], config: RelaxationConfig, reach_m: float) -> None:
        self.poses = np.zeros((ROOM, 3))
        """(ROOM, 3): x, y (m), theta (rad); the first `count` are valid."""
        self.rows = np.zeros((ROOM, 5), np.int64)
        """(ROOM, 5): see the columns above."""
        self.count = 0
        self._turn = 0
        self.adopt(models, config, reach_m)

    def adopt(self, models: tuple[ObjectModel, ...], config: RelaxationConfig, reach_m: float) -> None:
        """Go on with these; of the models the first are those from before."""
        self._models = models
        self._config = config
        self._reaches = tuple(float(np.hypot(*m.sides[:, :2].T).max()) + 0.5 * reach_m for m in models)

    @property
    def pending(self) -> bool:
        """Whether a placement has not come to rest."""
        return self.count > 0 and bool(self.rows[: self.count, LEFT].any())

    def put(self, number: int, model: int, pose: tuple[float, float, float], *, confirmed: bool) -> None:
        """Place a model, or put the one of this number elsewhere; the caller has seen that there is room."""
        k = self.find(number)
        if k < 0:
            k = self.count
            self.count += 1
        self.poses[k] = pose
        self.rows[k] = (number, model, self._config.iterations_max, confirmed, 0)

    def find(self, number: int) -> int:
        """Return the placement of an object, −1 where it is none."""
        found = np.flatnonzero(self.rows[: self.count, NUMBER] == number)
        return int(found[0]) if len(found) else -1

    def take_away(self, k: int) -> None:
        """Remove a placement."""
        for rows in (self.poses, self.rows):
            rows[k : self.count - 1] = rows[k + 1 : self.count].copy()
            rows[self.count - 1] = 0
        self.count -= 1

    def clear(self) -> None:
        """Remove all."""
        self.poses[:] = 0.0
        self.rows[:] = 0
        self.count = 0

    def members(self, k: int, outline: OutlineMap) -> Ints:
        """Return the slots of the segments around placement `k`."""
        middles = 0.5 * (outline.segments[:, :2] + outline.segments[:, 2:4])
        off = np.hypot(middles[:, 0] - self.poses[k, 0], middles[:, 1] - self.poses[k, 1])
        return np.flatnonzero((outline.alive > 0) & (off <= self._reaches[self.rows[k, MODEL]]))

    def wake(self, outline: OutlineMap) -> None:
        """Let those relax again whose segments are others than they were."""
        for k in range(self.count):
            heard = int(outline.numbers[self.members(k, outline)].sum())
            if heard != self.rows[k, HEARD]:
                self.rows[k, HEARD], self.rows[k, LEFT] = heard, self._config.iterations_max

    def wake_all(self) -> None:
        """Let all relax again, as under other constants."""
        self.rows[: self.count, LEFT] = self._config.iterations_max

    def refine(self, outline: OutlineMap) -> int:
        """Relax one placement that has not come to rest, by one quantum; return the increments applied."""
        config = self._config
        order = (self._turn + np.arange(self.count)) % max(1, self.count)
        k = int(next(k for k in order if self.rows[k, LEFT] > 0))
        self._turn = k + 1
        allowed = min(config.iterations_per_quantum, int(self.rows[k, LEFT]))
        done, rests = relax(
            self._models[self.rows[k, MODEL]].sides, outline.segments, self.members(k, outline), config.gamma,
            config.negligible_m, config.negligible_rad, allowed, self.poses[k],
        )  # fmt: skip
        self.rows[k, LEFT] = 0 if rests else self.rows[k, LEFT] - done
        return done


class Rejections:
    """Places where a person said that a model does not stand."""

    def __init__(self) -> None:
        self.rows = np.zeros((ROOM, 5))
        """(ROOM, 5): x, y, how far around (m), model, and the number of the newest segment at that time."""
        self.total = 0

    def add(self, x: float, y: float, reach_m: float, model: int, newest: int) -> None:
        """Remember one; the oldest makes room."""
        self.rows[self.total % ROOM] = (x, y, reach_m, model, newest)
        self.total += 1

    def since(self, x: float, y: float, model: int) -> int:
        """Return the number after which segments speak for a model at (x, y); 0 where all do."""
        newest = 0
        for row in self.rows[: min(self.total, ROOM)]:
            if row[3] == model and math.hypot(row[0] - x, row[1] - y) < row[2]:
                newest = max(newest, int(row[4]))
        return newest

    def clear(self) -> None:
        """Forget all."""
        self.rows[:] = 0.0
        self.total = 0


def facing_from(pose: Floats) -> tuple[float, float, float]:
    """Return a pose with its heading brought into [−π, π)."""
    x, y, theta = (float(v) for v in pose)
    return x, y, (theta + math.pi) % (2.0 * math.pi) - math.pi
