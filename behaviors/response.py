"""What every motor schema answers with: one named vector, so that the arbiter can add them without knowing them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Response:
    """A schema's vector in the odometry's frame, its gain already in it; magnitude 1 asks for the base velocity."""

    schema: str
    x: float
    y: float
