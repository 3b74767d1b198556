"""The records of surfaces, how each answers, and what a ray hits first."""

from __future__ import annotations

import math
from types import MappingProxyType
from typing import Any, Final, TypeAlias

import numpy as np

from drivers.emulator._jit import kernel

CONE: Final = 0
SPECULAR: Final = 1
RAYS: Final = 2
SILENT: Final = 3
SURFACES: Final = MappingProxyType({"cone": CONE, "specular": SPECULAR, "rays": RAYS, "silent": SILENT})
"""The models by their names in a world file."""
AS_WORLD: Final = -1
"""In place of a model: that of the world's acoustics."""

CIRCLE: Final = np.dtype((np.record, [("x", "f8"), ("y", "f8"), ("radius", "f8"), ("surface", "i8")]))
"""A round surface: its centre and radius, m, and how it answers."""
SEGMENT: Final = np.dtype((np.record, [("x1", "f8"), ("y1", "f8"), ("x2", "f8"), ("y2", "f8"), ("surface", "i8")]))
"""A straight surface: its two end points, m, and how it answers."""
CORNER: Final = np.dtype(
    (np.record, [("x", "f8"), ("y", "f8"), ("start", "f8"), ("opening", "f8"), ("surface", "i8"), ("beside", "i8")])
)
"""An open sector at a point where surfaces meet: the point, m, the direction in which the sector starts, its opening
counter-clockwise from there, rad, and how the surfaces at both sides of it answer; it does if both are mirrors."""
Records: TypeAlias = Any
"""A structured array of one of the types above, shape (n,). To a type checker it is anything: with `NDArray[Any]`,
which says no more of its fields, it tries all overloads of each operator between two of them, .2 s each."""


@kernel
def answers_by(wanted: int, surface: int, model: int) -> bool:
    """Return whether a surface answers by a model.

    Parameters
    ----------
    wanted
        The model asked for.
    surface
        How the surface answers: a model or `AS_WORLD`.
    model
        The model of the world's acoustics.
    """
    return surface == wanted or (surface == AS_WORLD and model == wanted)


@kernel
def models_present(model: int, circles: Records, segments: Records) -> int:
    """Return the models by which surfaces answer, as a set of bits.

    Parameters
    ----------
    model
        The model of the world's acoustics.
    circles, segments
        The surfaces: `CIRCLE` and `SEGMENT`, shape (n,) each.
    """
    present = 0
    for k in range(circles.shape[0]):
        present |= 1 << (model if circles[k].surface == AS_WORLD else circles[k].surface)
    for k in range(segments.shape[0]):
        present |= 1 << (model if segments[k].surface == AS_WORLD else segments[k].surface)
    return present


@kernel
def first_hit(x: float, y: float, direction: float, circles: Records, segments: Records) -> tuple[float, int]:
    """Return how far a ray goes to the first surface, m, +inf if there is none, and how that surface answers.

    Parameters
    ----------
    x, y
        Where the ray starts, m.
    direction
        Where it goes, rad.
    circles, segments
        The surfaces: `CIRCLE` and `SEGMENT`, shape (n,) each.
    """
    ux, uy = math.cos(direction), math.sin(direction)
    nearest, surface = math.inf, SILENT
    for k in range(circles.shape[0]):
        cx, cy, radius = circles[k].x - x, circles[k].y - y, circles[k].radius
        along, off = cx * ux + cy * uy, cx * uy - cy * ux
        reach = math.inf
        if math.hypot(cx, cy) <= radius:
            reach = 0.0
        elif along > 0.0 and abs(off) <= radius:
            reach = along - math.sqrt(radius * radius - off * off)
        if reach < nearest:
            nearest, surface = reach, circles[k].surface
    for k in range(segments.shape[0]):
        ax, ay = segments[k].x1 - x, segments[k].y1 - y
        vx, vy = segments[k].x2 - segments[k].x1, segments[k].y2 - segments[k].y1
        side_a = ux * ay - uy * ax
        side_b = side_a + ux * vy - uy * vx
        if side_a * side_b > 0.0 or side_a == side_b:
            continue
        reach = (ax * vy - ay * vx) / (side_b - side_a)
        if 0.0 < reach < nearest:
            nearest, surface = reach, segments[k].surface
    return nearest, surface
