"""Slow, readable oracle of the landmark filter: the right-invariant EKF with whole matrices.

It shares no code with the product. The state is the ring's heading, its place, the four slow states and the
landmarks; the error of each is defined as in A. Barrau and S. Bonnabel (2015): true heading θ = θ̂ + δθ, and every
place of the map p = R(δθ) p̂ + V(δθ) δp.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
HEADING, OFFSET, ODOMETER, TURN, RANGE = 0, 3, 4, 5, 6
QUARTER = np.array([[0.0, -1.0], [1.0, 0.0]])


def rotation(a: float) -> Array:
    """Return the matrix that turns by `a`."""
    return np.array([[math.cos(a), -math.sin(a)], [math.sin(a), math.cos(a)]])


def left_jacobian(a: float) -> Array:
    """Return V(a), the integral of the rotations from 0 to 1 times `a`, by the midpoint rule."""
    steps = a * (np.arange(2000) + 0.5) / 2000
    c, s = np.cos(steps).mean(), np.sin(steps).mean()
    return np.array([[c, -s], [s, c]])


@dataclass
class NaiveFilter:
    """The filter: mean and covariance, whose rows are heading, place, offset, three scales, landmarks."""

    heading: float
    place: Array
    covariance: Array
    offset: float = 0.0
    odometer_scale: float = 1.0
    turn_scale: float = 0.0
    range_scale: float = 1.0
    landmarks: list[Array] = field(default_factory=list)

    def lever(self) -> Array:
        """Return the column by which an error of the ring's turn enters."""
        column = np.zeros(len(self.covariance))
        column[HEADING] = 1.0
        for k, point in enumerate([self.place, *self.landmarks]):
            at = 1 if k == 0 else 5 + 2 * k
            column[at : at + 2] = -QUARTER @ point
        return column

    def propagate(
        self, reported: Array, travel: float, ring_turn: float, travel_turn: float,
        variances: tuple[float, float, float],
    ) -> None:  # fmt: skip
        """Move by odometry; `variances` are of the shared turn, of the wheels' turn alone, and of the place."""
        size = len(self.covariance)
        moved = rotation(self.heading + travel + self.offset) @ reported / self.odometer_scale
        jacobian = np.eye(size)
        jacobian[1:3, OFFSET] = QUARTER @ moved
        jacobian[1:3, ODOMETER] = -moved / self.odometer_scale
        self.place = self.place + moved
        lever = self.lever()
        turning = np.eye(size)
        turning[:, TURN] += ring_turn * lever
        offsetting = np.eye(size)
        offsetting[OFFSET, TURN] = travel_turn - ring_turn
        noise = np.zeros((size, size))
        noise[1:3, 1:3] = variances[2] * np.eye(2)
        p = jacobian @ self.covariance @ jacobian.T + noise
        p = turning @ p @ turning.T + variances[0] * np.outer(lever, lever)
        p = offsetting @ p @ offsetting.T
        p[OFFSET, OFFSET] += variances[1]
        self.covariance = p
        self.heading += ring_turn * (1.0 + self.turn_scale)
        self.offset += (travel_turn - ring_turn) * self.turn_scale

    def add(self, seen: Array, noise: Array) -> None:
        """Append a landmark seen at `seen` in the ring's frame, with its noise in the map frame."""
        size = len(self.covariance)
        copy = np.zeros((size + 2, size))
        copy[:size] = np.eye(size)
        copy[size, 1] = copy[size + 1, 2] = 1.0
        self.covariance = copy @ self.covariance @ copy.T
        self.covariance[size:, size:] += noise
        self.landmarks.append(self.place + rotation(self.heading) @ seen)

    def measure(self, i: int, mount: Array, radius: float, measured: float, variance: float) -> None:
        """Correct by the range from a sensor at `mount` in the ring's frame to landmark `i`."""
        sight = self.landmarks[i] - self.place - rotation(self.heading) @ mount
        distance = float(np.linalg.norm(sight))
        h = np.zeros(len(self.covariance))
        direction = self.range_scale * sight / distance
        h[1:3] = -direction
        h[7 + 2 * i : 9 + 2 * i] = direction
        h[RANGE] = distance - radius
        gain = self.covariance @ h / (h @ self.covariance @ h + variance)
        delta = gain * (measured - self.range_scale * (distance - radius))
        self.covariance = (np.eye(len(h)) - np.outer(gain, h)) @ self.covariance
        turn = float(delta[HEADING])
        self.place = rotation(turn) @ self.place + left_jacobian(turn) @ delta[1:3]
        self.landmarks = [
            rotation(turn) @ point + left_jacobian(turn) @ delta[7 + 2 * k : 9 + 2 * k]
            for k, point in enumerate(self.landmarks)
        ]
        self.heading += turn
        self.offset += float(delta[OFFSET])
        self.odometer_scale += float(delta[ODOMETER])
        self.turn_scale += float(delta[TURN])
        self.range_scale += float(delta[RANGE])
