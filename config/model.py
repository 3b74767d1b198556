"""Schema of the model file: the outline of an object as a polygon in the object's frame.

An outline that crosses itself or has an impossible size never fits and gives no hint why, so such files are refused
with the vertex at fault.
"""

from __future__ import annotations

import itertools
import math
from typing import Final, TypeAlias

from pydantic import Field, model_validator

from config.strict import Point, Strict, TomlList

Side: TypeAlias = tuple[tuple[float, float], tuple[float, float]]

EXTENT_MAX_M: Final = 20.0
"""Largest extent of an outline; a larger one was most likely given in millimetres."""
EXTENT_MIN_M: Final = 0.02
"""Smallest extent of an outline, below the resolution of a range."""
SAME_PLACE_M: Final = 1e-6
VERTICES_MAX: Final = 64
"""Greatest number of vertices of an outline."""
NAME_MAX: Final = 40
"""Characters of a name, which every list of objects shows."""


class ModelConfig(Strict):
    """Object model: a chain of vertices, open or closed, which may approximate an arc."""

    name: str = Field(min_length=1, max_length=NAME_MAX, pattern=r"^[A-Za-z0-9_-]+$")
    vertices_m: TomlList[Point] = Field(min_length=2, max_length=VERTICES_MAX)
    """Vertices of the outline in order; the origin is the point whose position is reported."""
    closed: bool
    arc_radius_m: float | None = Field(default=None, gt=0.0, le=100.0)
    """True radius about the origin if the vertices approximate an arc."""

    @property
    def reach_m(self) -> float:
        """Radius about the origin that holds the outline, m."""
        return self.arc_radius_m or max(math.hypot(x, y) for x, y in self.vertices_m)

    @model_validator(mode="after")
    def _proper_outline(self) -> ModelConfig:
        """Refuse an outline with too few or repeated vertices, or sides that cross."""
        vertices = self.vertices_m
        if self.closed and len(vertices) < 3:
            raise ValueError("a closed outline needs at least three vertices")
        self._refuse_wrong_size()
        for (i, a), (j, b) in itertools.combinations(enumerate(vertices), 2):
            if math.dist(a, b) < SAME_PLACE_M:
                hint = "; leave it out, closed = true closes the outline" if (i, j) == (0, len(vertices) - 1) else ""
                raise ValueError(f"vertex {j} {list(b)} repeats vertex {i}{hint}")
        sides = list(itertools.pairwise(vertices)) + ([(vertices[-1], vertices[0])] if self.closed else [])
        for (i, first), (j, second) in itertools.combinations(enumerate(sides), 2):
            neighbours = j == i + 1 or (self.closed and i == 0 and j == len(sides) - 1)
            if _folds_back(first, second) if neighbours else _meet(first, second):
                raise ValueError(
                    f"the side from vertex {j} crosses the side from vertex {i}; put the vertices in order"
                )
        return self

    def _refuse_wrong_size(self) -> None:
        extent = max(math.dist(a, b) for a, b in itertools.combinations(self.vertices_m, 2))
        farthest = max(range(len(self.vertices_m)), key=lambda i: math.hypot(*self.vertices_m[i]))
        corner = f"vertex {farthest} {list(self.vertices_m[farthest])}"
        reach = max(extent, math.hypot(*self.vertices_m[farthest]))
        if reach > EXTENT_MAX_M:
            raise ValueError(f"{corner} makes it {reach:g} m large, which looks like millimetres; give metres")
        if extent < EXTENT_MIN_M:
            raise ValueError(f"{corner}: the whole outline is {extent:g} m large, too small to be heard; give metres")


def _turn(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    """Return twice the signed area of a triangle, positive if a, b, c turn counter-clockwise."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _within(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> bool:
    """Return whether `c`, which lies on the line through `a` and `b`, lies between them."""
    return min(a[0], b[0]) <= c[0] <= max(a[0], b[0]) and min(a[1], b[1]) <= c[1] <= max(a[1], b[1])


def _meet(first: Side, second: Side) -> bool:
    """Return whether two sides have a point in common."""
    (a, b), (c, d) = first, second
    of_first, of_second = (_turn(c, d, a), _turn(c, d, b)), (_turn(a, b, c), _turn(a, b, d))
    if min(of_first) < 0.0 < max(of_first) and min(of_second) < 0.0 < max(of_second):
        return True
    ends = ((c, d, a, of_first[0]), (c, d, b, of_first[1]), (a, b, c, of_second[0]), (a, b, d, of_second[1]))
    return any(turn == 0.0 and _within(p, q, r) for p, q, r, turn in ends)


def _folds_back(first: Side, second: Side) -> bool:
    """Return whether two sides that share a vertex overlap."""
    shared = next(p for p in first if p in second)
    p, q = next(p for p in first if p != shared), next(p for p in second if p != shared)
    along = (p[0] - shared[0]) * (q[0] - shared[0]) + (p[1] - shared[1]) * (q[1] - shared[1])
    return _turn(shared, p, q) == 0.0 and along > 0.0
