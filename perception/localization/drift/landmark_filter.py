"""Right-invariant extended Kalman filter over the ring's pose, slow scales and landmarks: its kernels.

Formulas after A. Barrau and S. Bonnabel, "An EKF-SLAM algorithm with consistency properties" (2015), for the plane;
the scales are our addition. Every measurement is a scalar and enters with a sparse Jacobian, so that no matrix is
inverted. Each costs two passes over the covariance.
"""

from __future__ import annotations

import math
from typing import Final

from perception.kernel import Floats, kernel
from perception.localization.drift.landmark_state import (
    FIRST,
    HEADING,
    ODOMETER,
    OFFSET,
    RANGE,
    SCALE_MAX,
    TURN,
    EstimateRecord,
    X,
    Y,
)

SMALL_RAD: Final = 1e-6
"""Below this angle the series of sin a/a is used."""


@kernel
def rows_used(e: EstimateRecord) -> int:
    """Return the number of rows of the covariance that are in use."""
    return FIRST + 2 * e[0].count


@kernel
def add_row(covariance: Floats, n: int, target: int, source: int, factor: float) -> None:
    """Carry the error of one row over to another: F P Fᵀ with F = I + factor · e_target e_sourceᵀ.

    Parameters
    ----------
    covariance : (rows, rows) float
        P, updated.
    n : int
        Rows in use.
    target, source : int
        Rows.
    factor : float
        The derivative of the target with respect to the source.
    """
    for k in range(n):
        covariance[target, k] += factor * covariance[source, k]
    for k in range(n):
        covariance[k, target] += factor * covariance[k, source]


@kernel
def write_lever(e: EstimateRecord, lever: Floats) -> None:
    """Write how the error of each row changes with an error of the ring's turn: 1 for the heading, −J p̂ for a place.

    Parameters
    ----------
    e : (1,) Estimate
        The mean.
    lever : (rows,) float
        Out.
    """
    est = e[0]
    for k in range(FIRST):
        lever[k] = 0.0
    lever[HEADING], lever[X], lever[Y] = 1.0, est.y, -est.x
    for i in range(est.count):
        lever[FIRST + 2 * i] = est.landmarks[i].y
        lever[FIRST + 2 * i + 1] = -est.landmarks[i].x


@kernel
def propagate(
    e: EstimateRecord,
    covariance: Floats,
    forward: float,
    left: float,
    travel: float,
    ring_turn: float,
    travel_turn: float,
    variances: tuple[float, float, float],
) -> None:
    """Move the ring by what odometry reports.

    Parameters
    ----------
    e : (1,) Estimate
        The mean, updated.
    covariance : (rows, rows) float
        Updated.
    forward, left : float
        Reported displacement, in the frame of the direction of travel before it, m.
    travel : float
        Reported angle from the ring's direction to the direction of travel before it, rad.
    ring_turn, travel_turn : float
        Reported turn of the ring, and of the direction of travel, rad.
    variances : (float, float, float)
        Variance of the turn's error that ring and wheels share, and of that of the wheels alone, rad²; and of the
        displacement on each axis, m².
    """
    turn_variance, offset_variance, place_variance = variances
    est = e[0]
    n = rows_used(e)
    direction = est.heading + travel + est.offset
    c = math.cos(direction) / est.odometer_scale
    s = math.sin(direction) / est.odometer_scale
    dx = c * forward - s * left
    dy = s * forward + c * left
    if dx != 0.0 or dy != 0.0:
        add_row(covariance, n, X, OFFSET, -dy)
        add_row(covariance, n, Y, OFFSET, dx)
        add_row(covariance, n, X, ODOMETER, -dx / est.odometer_scale)
        add_row(covariance, n, Y, ODOMETER, -dy / est.odometer_scale)
        covariance[X, X] += place_variance
        covariance[Y, Y] += place_variance
        est.x += dx
        est.y += dy
    if ring_turn != 0.0 or turn_variance > 0.0:
        lever = est.lever
        write_lever(e, lever)
        if ring_turn != 0.0:
            for k in range(n):
                if lever[k] != 0.0:
                    add_row(covariance, n, k, TURN, ring_turn * lever[k])
        for i in range(n):
            for k in range(n):
                covariance[i, k] += turn_variance * lever[i] * lever[k]
        est.heading += ring_turn * (1.0 + est.turn_scale)
    if travel_turn != ring_turn:
        add_row(covariance, n, OFFSET, TURN, travel_turn - ring_turn)
        est.offset += (travel_turn - ring_turn) * est.turn_scale
    covariance[OFFSET, OFFSET] += offset_variance


@kernel
def move_points(e: EstimateRecord, turn: float, gain: Floats, factor: float) -> None:
    """Move the position and all landmarks by a correction: p ← R(δθ) p + V(δθ) δp.

    Parameters
    ----------
    e : (1,) Estimate
        Updated.
    turn : float
        δθ, rad.
    gain : (rows,) float
        Times `factor`, the correction of each row.
    factor : float
        The innovation.
    """
    est = e[0]
    c, s = math.cos(turn), math.sin(turn)
    if abs(turn) < SMALL_RAD:
        a, b = 1.0, 0.5 * turn
    else:
        a, b = s / turn, (1.0 - c) / turn
    vx, vy = factor * gain[X], factor * gain[Y]
    x = c * est.x - s * est.y + a * vx - b * vy
    est.y = s * est.x + c * est.y + b * vx + a * vy
    est.x = x
    for i in range(est.count):
        landmark = est.landmarks[i]
        vx, vy = factor * gain[FIRST + 2 * i], factor * gain[FIRST + 2 * i + 1]
        x = c * landmark.x - s * landmark.y + a * vx - b * vy
        landmark.y = s * landmark.x + c * landmark.y + b * vx + a * vy
        landmark.x = x


@kernel
def innovation_variance(
    covariance: Floats, n: int, row: int, ux: float, uy: float, by_scale: float, gain: Floats
) -> float:
    """Return the variance of a predicted distance, H P Hᵀ, and write P Hᵀ.

    H is −u for the ring's position, u for the landmark, and `by_scale` for the range scale.

    Parameters
    ----------
    covariance : (rows, rows) float
        P.
    n : int
        Rows in use.
    row : int
        Row of the landmark's x.
    ux, uy, by_scale : float
        Derivatives by the landmark's place, and by the range scale.
    gain : (rows,) float
        Out: P Hᵀ.
    """
    for k in range(n):
        gain[k] = (
            ux * (covariance[k, row] - covariance[k, X])
            + uy * (covariance[k, row + 1] - covariance[k, Y])
            + by_scale * covariance[k, RANGE]
        )
    variance: float = ux * (gain[row] - gain[X]) + uy * (gain[row + 1] - gain[Y]) + by_scale * gain[RANGE]
    return variance


@kernel
def correct(e: EstimateRecord, covariance: Floats, innovation: float, variance: float) -> None:
    """Correct mean and covariance by one scalar measurement.

    Parameters
    ----------
    e : (1,) Estimate
        Updated; its `gain` holds P Hᵀ.
    covariance : (rows, rows) float
        Updated.
    innovation, variance : float
        Measured less predicted value, and its variance, noise included.
    """
    est = e[0]
    n = rows_used(e)
    gain = est.gain
    for i in range(n):
        share = gain[i] / variance
        for k in range(i + 1):
            covariance[i, k] -= share * gain[k]
            covariance[k, i] = covariance[i, k]
    factor = innovation / variance
    est.offset += factor * gain[OFFSET]
    est.offset_correction += factor * gain[OFFSET]
    est.heading_correction += factor * gain[HEADING]
    est.odometer_scale = min(SCALE_MAX, max(1.0 / SCALE_MAX, est.odometer_scale + factor * gain[ODOMETER]))
    est.turn_scale += factor * gain[TURN]
    est.range_scale = min(SCALE_MAX, max(1.0 / SCALE_MAX, est.range_scale + factor * gain[RANGE]))
    turn = factor * gain[HEADING]
    move_points(e, turn, gain, factor)
    est.heading += turn


@kernel
def add_landmark(
    e: EstimateRecord, covariance: Floats, ahead: float, left: float, xx: float, xy: float, yy: float
) -> int:
    """Append a landmark that was measured relative to the ring; return its index, −1 where there is no room.

    Parameters
    ----------
    e : (1,) Estimate
        Updated; radius and number of the new landmark are left to the caller.
    covariance : (rows, rows) float
        Updated.
    ahead, left : float
        Its place in the ring's frame, m.
    xx, xy, yy : float
        Covariance of that, turned into the map frame, m².
    """
    est = e[0]
    if est.count == len(est.landmarks):
        return -1
    i = est.count
    row = FIRST + 2 * i
    for k in range(row):
        covariance[row, k] = covariance[k, row] = covariance[X, k]
        covariance[row + 1, k] = covariance[k, row + 1] = covariance[Y, k]
    covariance[row, row] = covariance[X, X] + xx
    covariance[row + 1, row + 1] = covariance[Y, Y] + yy
    covariance[row, row + 1] = covariance[row + 1, row] = covariance[X, Y] + xy
    c, s = math.cos(est.heading), math.sin(est.heading)
    landmark = est.landmarks[i]
    landmark.x = est.x + c * ahead - s * left
    landmark.y = est.y + s * ahead + c * left
    landmark.failures = 0
    landmark.hits = 0
    landmark.moved = 0
    landmark.drift_nat = 0.0
    est.count += 1
    return i


@kernel
def remove_landmark(e: EstimateRecord, covariance: Floats, i: int) -> None:
    """Remove a landmark; the last one takes its place.

    Parameters
    ----------
    e : (1,) Estimate
        Updated.
    covariance : (rows, rows) float
        Updated.
    i : int
        Index of the landmark.
    """
    est = e[0]
    last = est.count - 1
    if i != last:
        source, target = est.landmarks[last], est.landmarks[i]
        target.x, target.y, target.radius = source.x, source.y, source.radius
        target.number, target.failures, target.hits = source.number, source.failures, source.hits
        target.moved = source.moved
        target.anchor_x, target.anchor_y = source.anchor_x, source.anchor_y
        target.drift_nat = source.drift_nat
        for axis in range(2):
            to, of = FIRST + 2 * i + axis, FIRST + 2 * last + axis
            for k in range(FIRST + 2 * last + 2):
                covariance[to, k] = covariance[of, k]
            for k in range(FIRST + 2 * last + 2):
                covariance[k, to] = covariance[k, of]
    est.count = last
