"""An object model as an array of the sides of its outline, as the kernels take it (paper §3.4)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from config.model import ModelConfig
from perception.kernel import Floats
from perception.shared_numbers import ROUNDING


@dataclass(frozen=True, slots=True, eq=False)
class ObjectModel:
    """The outline of an object in its own frame."""

    name: str
    """The model's name."""
    sides: Floats
    """(m, 4): middle x, y (m), direction (rad) and length (m) of each side."""
    centroid: tuple[float, float]
    """Mean of the outline, weighted by length, m."""
    facing: float | None
    """The direction in which an open outline bulges, rad. None for a closed outline: it gives no first guess."""
    lever_m: float | None = None
    """Root mean square distance of the outline from its mean, m: what a heading is measured by. None if it is
    round."""

    @classmethod
    def from_config(cls, config: ModelConfig) -> ObjectModel:
        """Return the model that a model file describes."""
        vertices = np.array(config.vertices_m, dtype=np.float64)
        begin = vertices if config.closed else vertices[:-1]
        end = np.roll(vertices, -1, axis=0) if config.closed else vertices[1:]
        along = end - begin
        middle = 0.5 * (begin + end)
        length = np.hypot(along[:, 0], along[:, 1])
        sides = np.column_stack([middle, np.arctan2(along[:, 1], along[:, 0]), length])
        centroid = (length[:, None] * middle).sum(axis=0) / length.sum()
        bulge = centroid - 0.5 * (vertices[0] + vertices[-1])
        facing = None
        if not config.closed:
            straight = math.hypot(*bulge) < ROUNDING
            across = math.atan2(along[0, 1], along[0, 0]) + 0.5 * math.pi
            facing = across if straight else math.atan2(bulge[1], bulge[0])
        lever_m = None
        if config.arc_radius_m is None:
            lever_m = math.sqrt(float((length * ((middle - centroid) ** 2).sum(axis=1)).sum() / length.sum()))
        place = (float(centroid[0]), float(centroid[1]))
        return cls(config.name, np.ascontiguousarray(sides), place, facing, lever_m)

    def sigma_theta(self, sigma: float) -> float | None:
        """Return the standard error of the heading, rad, for one of the place, m; None if the outline is round."""
        return sigma / self.lever_m if self.lever_m else None
