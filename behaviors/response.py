"""The result of a motor schema: one named vector, so that the arbiter can add vectors of any schemas."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from config.bounded import VectorPart


@dataclass(frozen=True, slots=True)
class Response:
    """A schema's vector in the odometry's frame, its gain included; length 1 requests the base velocity."""

    schema: str
    x: VectorPart
    y: VectorPart


def summed(responses: Iterable[Response]) -> tuple[float, float]:
    """Return the sum of vectors, (x, y)."""
    x = y = 0.0
    for response in responses:
        x += response.x
        y += response.y
    return x, y
