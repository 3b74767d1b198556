"""Scales, mounts and surfaces that explain the ranges of a drive best: a robust least-squares fit.

A range of a mirroring surface depends on where the sensor stands, not on where it looks. So places and scales follow
from ranges alone, and directions, in `beam_fit`, from which bearings are answered.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from perception.calibration.drive import KNOT_M, Drive, Path, Scales
from perception.calibration.surfaces import Beams, Echoes, Surfaces
from perception.kernel import Floats

GAUSS_NEWTON_ROUNDS_MAX: Final = 40
"""Most rounds of Gauss-Newton, each with readings chosen anew."""
CONVERGED: Final = 1e-7
"""A round that changes no parameter by more is the last one, in the parameters' units."""
GATES_M: Final = (0.25, 0.25, 0.2, 0.15, 0.12, 0.1, 0.1, 0.08, 0.08, 0.06, 0.06, 0.04, 0.04)
"""Misfit up to which a reading counts in the first rounds, m: slowly down, so that no sensor is left behind."""
GATE_SIGMAS: Final = 4.0
"""The same in the later rounds, standard deviations."""
HUBER_SIGMAS: Final = 1.5
"""Misfit beyond which a reading's weight falls, standard deviations."""
STEP: Final = 1e-6
"""Step of numerical derivatives, in the parameter's unit."""
RANGE_SIGMA_MIN_M: Final = 5e-4
"""Least standard deviation of a reading, m."""


@dataclass(frozen=True, slots=True)
class Priors:
    """Standard deviations of what is known before the drive."""

    scale: float = 0.05
    """Of each scale."""
    mount_m: float = 0.04
    """Of each coordinate of a sensor's place, m."""
    bend_rad_per_sqrt_m: float = 0.002
    """Of the heading's random walk, rad per √m."""
    radius_m: float = 0.001
    """Of the radius of a round object that was measured, m."""
    way_m: float = 0.002
    """Of the distance between both ends of the drive that was measured, m."""


@dataclass(frozen=True, slots=True, eq=False)
class Geometry:
    """All that ranges depend on."""

    scales: Scales
    """Of odometry and ranges."""
    surfaces: Surfaces
    """Walls and round objects, in the frame of the drive's first pose."""
    mounts: Floats
    """(n, 2): place of each sensor in the ring's frame, m."""
    bends: Floats
    """(knots,): as for `Drive.path`."""


class RangeNoise(NamedTuple):
    """The standard deviation of a range: a constant, and a share of the range, which add as squares."""

    constant_m: float
    """m."""
    share: float
    """Of the range."""

    def sigmas(self, ranges: Floats) -> Floats:
        """Return the standard deviation of each range, m."""
        sigmas: Floats = np.hypot(self.constant_m, self.share * ranges)
        return sigmas


@dataclass(frozen=True, slots=True, eq=False)
class GeometryFit:
    """The result of a fit."""

    geometry: Geometry
    """The estimate."""
    scale_sigmas: Scales
    """Standard deviation of each scale."""
    mount_sigmas_m: Floats
    """(n,): that of each sensor's place, the greater of its two axes, m."""
    readings: NDArray[np.intp]
    """(n,): readings of each sensor that took part."""
    noise: RangeNoise
    """Of the ranges."""


def sensors_at(path: Path, echoes: Echoes, mounts: Floats, angles: Floats) -> Beams:
    """Return where the sensors of readings stand and look.

    Parameters
    ----------
    path
        The poses of the ring.
    echoes
        The readings, shape (m,).
    mounts, angles
        Place (m), shape (n, 2), and direction (rad), shape (n,), of each sensor in the ring's frame.
    """
    yaw, centre, mount = path.yaw[echoes.firing], path.xy[echoes.firing], mounts[echoes.sensor]
    c, s = np.cos(yaw), np.sin(yaw)
    x = centre[:, 0] + c * mount[:, 0] - s * mount[:, 1]
    y = centre[:, 1] + s * mount[:, 0] + c * mount[:, 1]
    return Beams(x, y, yaw + angles[echoes.sensor])


class _Vector:
    """The parameters of a geometry as a vector: scales, walls, drums, bends; and then the mounts."""

    def __init__(self, geometry: Geometry) -> None:
        self._shape = geometry
        self.walls, self.drums = len(geometry.surfaces.walls), len(geometry.surfaces.drums)
        self.common = 3 + 2 * self.walls + 3 * self.drums + len(geometry.bends)

    def pack(self, geometry: Geometry) -> Floats:
        """Return the parameters of a geometry with as many surfaces and sensors as the first."""
        surfaces = geometry.surfaces
        return np.concatenate(
            [
                geometry.scales,
                surfaces.walls.ravel(),
                surfaces.drums.ravel(),
                geometry.bends,
                geometry.mounts.ravel(),
            ]
        )

    def unpack(self, vector: Floats) -> Geometry:
        scales = Scales(*vector[:3].tolist())
        at = 3 + 2 * self.walls
        walls, drums = vector[3:at].reshape(-1, 2), vector[at : at + 3 * self.drums].reshape(-1, 3)
        bends = vector[at + 3 * self.drums : self.common]
        return Geometry(scales, Surfaces(walls, drums), vector[self.common :].reshape(-1, 2), bends)


def fit_geometry(
    drive: Drive,
    echoes: Echoes,
    angles: Floats,
    half_angle: float,
    start: Geometry,
    priors: Priors,
    way_m: float | None,
    *,
    synchro: bool,
) -> GeometryFit:
    """Return the geometry that explains the ranges best.

    Parameters
    ----------
    drive, echoes
        The drive, and its finite readings.
    angles
        Direction of each sensor in the ring's frame, rad, shape (n,).
    half_angle
        Bearing off its axis up to which a sensor's reading counts, rad.
    start
        First guess; its mounts and radii are those before the drive.
    priors
        How well they are known.
    way_m
        Measured distance from the first to the last pose, m; without it, a round object's radius alone shows lengths.
    synchro
        The ring does not turn with the wheels.

    Notes
    -----
    Gauss-Newton with Huber's weights. Derivatives by the mounts are exact, the others numerical.
    """
    vector = _Vector(start)
    prior = vector.pack(start)
    prior[:3] = 1.0
    at = prior.copy()
    at[:3] = start.scales
    sigma = _prior_sigmas(vector, start, priors)
    range_sigma = np.full(len(echoes.sensor), GATES_M[0])
    information, chosen = np.zeros((len(at), len(at))), np.zeros(0, dtype=np.intp)
    for k in range(GAUSS_NEWTON_ROUNDS_MAX):
        geometry = vector.unpack(at)
        path = drive.path(geometry.scales, geometry.bends, synchro=synchro)
        beams = sensors_at(path, echoes, geometry.mounts, angles)
        gate = np.full(len(range_sigma), GATES_M[k]) if k < len(GATES_M) else GATE_SIGMAS * range_sigma
        chosen, surface = _choose(geometry, beams, echoes, half_angle, gate)
        picked = echoes.chosen(chosen)

        def misfits(values: Floats, picked: Echoes = picked, surface: NDArray[np.intp] = surface) -> Floats:
            g = vector.unpack(values)
            moved = drive.path(g.scales, g.bends, synchro=synchro)
            stand = sensors_at(moved, picked, g.mounts, angles)
            distance, _ = g.surfaces.distances(stand.x, stand.y)
            # In reported ranges: in true ones, a larger scale of the range would make all misfits smaller.
            return picked.range_m - g.scales.range * distance[surface, np.arange(len(surface))]

        here = misfits(at)
        _, bearing = geometry.surfaces.distances(beams.x[chosen], beams.y[chosen])
        towards = bearing[surface, np.arange(len(surface))] - path.yaw[picked.firing]
        # A noise below the misfit of a sensor whose place is not yet found would make its readings outliers.
        noise = _range_noise(picked.range_m, here) if k >= len(GATES_M) else RangeNoise(GATES_M[k] / GATE_SIGMAS, 0.0)
        range_sigma = noise.sigmas(echoes.range_m)
        expected = range_sigma[chosen]
        jacobian = _jacobian(vector, at, misfits, here, geometry, picked.sensor, towards)
        weight = np.minimum(1.0, HUBER_SIGMAS * expected / np.maximum(np.abs(here), 1e-12)) / expected**2
        information = jacobian.T @ (weight[:, None] * jacobian) + np.diag(sigma**-2)
        gradient = jacobian.T @ (weight * here) + (at - prior) / sigma**2
        if way_m is not None:
            measured = _way_row(vector, at, drive, synchro=synchro)
            information += np.outer(measured[1], measured[1]) / priors.way_m**2
            gradient += measured[1] * (measured[0] - way_m) / priors.way_m**2
        change = np.linalg.solve(information, gradient)
        at = at - change
        if k >= len(GATES_M) and np.abs(change).max() < CONVERGED:
            break
    covariance = np.linalg.inv(information)
    sigmas = np.sqrt(np.diag(covariance))
    places = covariance[vector.common :, vector.common :]
    greatest = [
        math.sqrt(float(np.linalg.eigvalsh(places[i : i + 2, i : i + 2])[-1])) for i in range(0, len(places), 2)
    ]
    readings = np.bincount(echoes.sensor[chosen], minlength=len(start.mounts))
    return GeometryFit(vector.unpack(at), Scales(*sigmas[:3].tolist()), np.array(greatest), readings, noise)


def _prior_sigmas(vector: _Vector, start: Geometry, priors: Priors) -> Floats:
    """Return what each parameter may differ by from the first guess; a surface may be anywhere within 10 m or rad."""
    drums = np.tile([10.0, 10.0, priors.radius_m], vector.drums)
    bend = priors.bend_rad_per_sqrt_m * math.sqrt(KNOT_M)
    return np.concatenate(
        [
            [priors.scale] * 3,
            np.full(2 * vector.walls, 10.0),
            drums,
            np.full(len(start.bends), bend),
            np.full(2 * len(start.mounts), priors.mount_m),
        ]
    )


def _range_noise(ranges: Floats, misfits: Floats) -> RangeNoise:
    """Return the noise that misfits show: by the medians of the nearer and of the farther half of the readings."""
    far = ranges > np.median(ranges) if len(ranges) else np.zeros(0, dtype=np.bool_)
    if not far.any():  # few readings, or all of one range: a robot that stands
        return RangeNoise(max(RANGE_SIGMA_MIN_M, _spread(misfits)), 0.0)
    squares = [(float(np.mean(ranges[half] ** 2)), _spread(misfits[half]) ** 2) for half in (~far, far)]
    (near_m2, near), (far_m2, beyond) = squares
    share = math.sqrt(max(0.0, (beyond - near) / (far_m2 - near_m2))) if far_m2 > near_m2 else 0.0
    return RangeNoise(max(RANGE_SIGMA_MIN_M, math.sqrt(max(0.0, near - share**2 * near_m2))), share)


def _spread(values: Floats) -> float:
    """Return the standard deviation that the median of absolute values implies; 0 without values."""
    return 1.4826 * float(np.median(np.abs(values))) if len(values) else 0.0


def _choose(
    geometry: Geometry, beams: Beams, echoes: Echoes, half_angle: float, gate: Floats
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return which readings are echoes of a surface, and of which: the one in the beam that fits it best.

    `gate`: greatest difference of measured and expected range, m, of each reading.
    """
    distance, bearing = geometry.surfaces.distances(beams.x, beams.y)
    turned = np.remainder(bearing - beams.axis + math.pi, 2.0 * math.pi) - math.pi
    misfit = np.abs(echoes.range_m - geometry.scales.range * distance)
    misfit[(np.abs(turned) > half_angle) | (distance < 0.0)] = np.inf
    surface = misfit.argmin(axis=0)
    chosen = np.flatnonzero(misfit[surface, np.arange(len(surface))] < gate)
    return chosen, surface[chosen]


def _jacobian(
    vector: _Vector,
    at: Floats,
    misfits: Callable[[Floats], Floats],
    here: Floats,
    geometry: Geometry,
    sensor: NDArray[np.intp],
    towards: Floats,
) -> Floats:
    """Return the derivatives of the misfits, shape (readings, parameters).

    Each reading is that of a `sensor`, whose surface lies in the direction `towards` from the ring's front, rad.
    """
    jacobian = np.zeros((len(here), len(at)))
    for i in range(vector.common):
        moved = at.copy()
        moved[i] += STEP
        jacobian[:, i] = (misfits(moved) - here) / STEP
    # The distance falls by as much as the sensor moves towards the surface.
    rows, column = np.arange(len(here)), vector.common + 2 * sensor
    jacobian[rows, column] = geometry.scales.range * np.cos(towards)
    jacobian[rows, column + 1] = geometry.scales.range * np.sin(towards)
    return jacobian


def _way_row(vector: _Vector, at: Floats, drive: Drive, *, synchro: bool) -> tuple[float, Floats]:
    """Return the distance between both ends of the drive, m, and its derivatives."""

    def ends_m(values: Floats) -> float:
        g = vector.unpack(values)
        return float(np.hypot(*np.diff(drive.path(g.scales, g.bends, synchro=synchro).xy[[0, -1]], axis=0)[0]))

    here, row = ends_m(at), np.zeros(len(at))
    for i in range(vector.common):
        moved = at.copy()
        moved[i] += STEP
        row[i] = (ends_m(moved) - here) / STEP
    return here, row
