"""An object model as the kernels want it: the sides of a polygon, ready to be moved and turned (paper §3.4)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from config.model import ModelConfig
from perception.kernel import Floats


@dataclass(frozen=True, slots=True, eq=False)
class ObjectModel:
    """The outline of an object in its own frame.

    `sides` has shape (m, 4): middle x, y (m), direction (rad) and length (m) of each side. `centroid` is the middle
    of the outline, weighted by length. `facing` is the direction in which an open outline bulges, None for a closed
    one, which looks alike from everywhere as far as a first guess goes.
    """

    name: str
    sides: Floats
    centroid: tuple[float, float]
    facing: float | None

    @classmethod
    def from_config(cls, config: ModelConfig) -> ObjectModel:
        """Build the model of a model file."""
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
            straight = math.hypot(*bulge) < 1e-9
            across = math.atan2(along[0, 1], along[0, 0]) + 0.5 * math.pi
            facing = across if straight else math.atan2(bulge[1], bulge[0])
        return cls(config.name, np.ascontiguousarray(sides), (float(centroid[0]), float(centroid[1])), facing)
