"""The model file: the outline of an object to be recognised, as a polygon in the object's own frame."""

from __future__ import annotations

import math

from pydantic import Field, model_validator

from config.strict import Many, Point, Strict


class ModelConfig(Strict):
    """An object model: a chain of vertices, open or closed, perhaps standing for an arc."""

    name: str = Field(min_length=1, pattern=r"^[A-Za-z0-9_-]+$")
    vertices_m: Many[Point] = Field(min_length=2, max_length=64)
    """Corners of the outline in order; the origin is the point whose position is reported."""
    closed: bool
    arc_radius_m: float | None = Field(default=None, gt=0.0, le=100.0)
    """The true radius about the origin where the vertices approximate an arc."""

    @model_validator(mode="after")
    def _proper_outline(self) -> ModelConfig:
        ends = zip(self.vertices_m, self.vertices_m[1:] + self.vertices_m[:1], strict=True)
        sides = list(ends) if self.closed else list(ends)[:-1]
        for i, (a, b) in enumerate(sides):
            if math.dist(a, b) < 1e-6:
                raise ValueError(f"vertex {(i + 1) % len(self.vertices_m)} repeats vertex {i}")
        if self.closed and len(self.vertices_m) < 3:
            raise ValueError("a closed outline needs at least three vertices")
        return self
