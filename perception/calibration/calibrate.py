"""A robot's calibration from one drive: what its mounts, beams and scales are, and how well each is known."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from config.robot import RingConfig
from drivers.messages import Firing
from perception.calibration.beam_fit import HALF_ANGLE_STEP_RAD, BeamFit, Looks, best_beam, fit_beams, fit_directions
from perception.calibration.drive import Drive, Scales, drive_of
from perception.calibration.geometry_fit import (
    GATE_SIGMAS,
    Geometry,
    GeometryFit,
    Priors,
    RangeNoise,
    fit_geometry,
    sensors_at,
)
from perception.calibration.surfaces import UNSURE_RAD, Beams, Echoes, Surfaces, find_surfaces, most_voted_wall
from perception.kernel import Floats

PRIORS: Final = Priors()
"""What is known of any robot before the drive."""
WALLS_MAX: Final = 4
"""Most walls that are looked for."""
CALIBRATION_ROUNDS: Final = 2
"""Rounds of places and directions, each with the other's result."""
TURN_SCALES: Final = (1.0, *(1.0 + sign * 0.005 * k for k in range(1, 11) for sign in (1, -1)))
"""Turn scales that are tried first: a wall is smeared over two turns by twice the error."""
TURN_STARTS: Final = 5
"""Turn scales from which a rough fit begins, those under which a wall looks sharpest."""
TURN_STARTS_APART: Final = 0.015
"""They are at least so far apart."""
SURFACE_SHARE: Final = 0.05
"""Share of the readings that one surface more must explain: a wrong turn scale shows ghosts of a wall."""
FIT_ECHOES_MAX: Final = 3000
"""Echoes that are enough for that."""
LOOK_MAX_RAD: Final = math.radians(45.0)
"""Greatest bearing of a surface off a sensor's axis at which its reading is a look at that surface."""
SURE_RAD: Final = math.radians(5.0)
"""Off-axis bearing at which a wall answers for sure."""
LISTENED_SHARE: Final = 0.9
"""Share of the longest range up to which silence means that nothing is there."""
SCALE_SHOWN: Final = 0.1
"""A drive shows a scale if it leaves at most this share of its standard deviation before the drive. Suitable drives
leave 0.004 to 0.03. Drives without a whole turn left 0.2 to 1 of that of the turn's scale, and found it by up to 12 %
wrong."""
PLACE_SHOWN: Final = 0.25
"""The same of a place. Suitable drives leave 0.04 to 0.24, the latter if they are quick."""
HALF_SHOWN: Final = 0.5
"""A sensor's place takes part in the comparison of both halves of a drive if each leaves at most this share of its
standard deviation before the drive."""
CHANCE_SIGMAS: Final = 3.09
"""Values of one kind are changed only if noise alone would make them differ by so much in 1 of 1,000 drives."""


class Halves(NamedTuple):
    """How far the fits to the two halves of a drive differ: a drive among unknown objects contradicts itself.

    Each but the last is a mean square over the one that the fits' own variances explain (Birge's ratio).
    """

    scales: Floats
    """Of each scale, shape (3,)."""
    places: float
    """Of the sensors' places and the scales together."""
    directions: float
    """Of the sensors' directions."""
    half_angle: float
    """Difference between both half angles of the beam, rad."""


@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """What a drive shows of a robot.

    What it does not show has its nominal value, and infinite as its uncertainty. What differs from the nominal value
    by no more than the noise of the drive explains has that value, too, with its own uncertainty. Where the
    halves of the drive differ by more than their noise explains, the uncertainties are greater by as much.
    """

    mounts: Floats
    """(n, 3): place (m) and direction (rad) of each sensor in the ring's frame."""
    place_sigmas_m: Floats
    angle_sigmas_rad: Floats
    """(n,): standard deviations; a direction is shown only of a sensor whose place is."""
    readings: NDArray[np.intp]
    """(n,): echoes of each sensor that took part."""
    half_angle_rad: float
    """Half of the beam's opening; the nominal one unless the drive shows directions."""
    everything_echoes: bool
    """Whether all in the beam answers, not only mirrors."""
    scales: Scales
    scale_sigmas: Scales
    """Of odometry and ranges, reported over true."""
    noise: RangeNoise
    """Of the ranges."""
    walls: int
    drums: int
    """Surfaces that were found."""
    has_gain: bool
    """Whether anything has another value than the nominal one."""

    @property
    def shows_any(self) -> bool:
        """Whether the drive shows anything of the robot."""
        return bool(np.isfinite([*self.place_sigmas_m, *self.scale_sigmas]).any())


def calibrate(
    firings: Sequence[Firing],
    ring: RingConfig,
    radii: Sequence[float],
    way_m: float | None,
    *,
    synchro: bool,
) -> Calibration | None:
    """Return what a drive by walls and round objects shows of the robot; None if no surface was found.

    Parameters
    ----------
    firings
        Those of the drive, oldest first.
    ring
        The nominal ring.
    radii
        Measured radius of each round object, m.
    way_m
        Measured distance from the first to the last pose, m; without it, a round object's radius alone shows lengths.
    synchro
        The ring does not turn with the wheels.
    """
    drive = drive_of(firings, ring.range_min_m + ring.resolution_m)
    nominal, half_angle = np.array(ring.mounts), math.radians(ring.beam_half_angle_deg)
    echoes = _echoes_of(drive)
    # At first, readings count only so far within the beam that the sensor hears the surface for sure.
    angles, inside = nominal[:, 2], max(0.5 * half_angle, half_angle - UNSURE_RAD)
    start = _first_guess(drive, echoes, nominal, inside, half_angle, radii, way_m, synchro=synchro)
    if start is None:
        return None
    for _ in range(CALIBRATION_ROUNDS):
        fit = fit_geometry(drive, echoes, angles, inside, start, PRIORS, way_m, synchro=synchro)
        beam_fit = fit_beams(_looks(drive, fit, nominal[:, 2], synchro=synchro), len(nominal))
        angles = nominal[:, 2] + beam_fit.turns
        inside = beam_fit.half_angle
    halves = _halves(drive, fit, beam_fit, nominal, synchro=synchro)
    return _shown(fit, beam_fit, _turn_sigmas(beam_fit, fit, echoes), halves, nominal, half_angle)


def _echoes_of(drive: Drive) -> Echoes:
    """Return the finite readings of a drive."""
    firing, sensor = np.nonzero(np.isfinite(drive.ranges))
    return Echoes(firing, sensor, drive.ranges[firing, sensor])


def _turn_sigmas(beams: BeamFit, fit: GeometryFit, echoes: Echoes) -> Floats:
    """Return the standard deviations of the directions, rad; a bearing is as wrong as the sensor's place is."""
    return np.hypot(beams.sigmas, fit.mount_sigmas_m / np.median(echoes.range_m))


def _halves(drive: Drive, fit: GeometryFit, beam_fit: BeamFit, nominal: Floats, *, synchro: bool) -> Halves:
    """Return how far fits to the first and to the second half of the readings differ."""
    geometry, half = fit.geometry, len(drive.ranges) // 2
    start = Geometry(geometry.scales, geometry.surfaces, nominal[:, :2], np.zeros(drive.knots))
    angles, everything = nominal[:, 2] + beam_fit.turns, beam_fit.everything_echoes
    fits, directions, sigmas, half_angles = [], [], [], []
    for others in (slice(half, None), slice(None, half)):
        ranges = drive.ranges.copy()
        ranges[others] = np.nan
        part = replace(drive, ranges=ranges)
        echoes = _echoes_of(part)
        if not len(echoes.sensor):
            return Halves(np.full(3, np.inf), math.inf, math.inf, math.inf)
        found = fit_geometry(part, echoes, angles, beam_fit.half_angle, start, PRIORS, None, synchro=synchro)
        looks = _looks(part, found, nominal[:, 2], synchro=synchro)
        beams = fit_directions(looks, len(nominal), beam_fit.half_angle, everything=everything)
        fits.append(found)
        directions.append(beams.turns)
        sigmas.append(_turn_sigmas(beams, found, echoes))
        half_angles.append(best_beam(looks, len(nominal))[0])
    one, other = fits
    variances = np.array(one.scale_sigmas) ** 2 + np.array(other.scale_sigmas) ** 2
    scales = (np.array(one.geometry.scales) - np.array(other.geometry.scales)) ** 2 / variances
    is_known = np.maximum(one.mount_sigmas_m, other.mount_sigmas_m) <= HALF_SHOWN * PRIORS.mount_m
    apart = ((one.geometry.mounts - other.geometry.mounts) ** 2).sum(axis=1)[is_known]
    places = apart / (one.mount_sigmas_m**2 + other.mount_sigmas_m**2)[is_known]
    variance = sigmas[0] ** 2 + sigmas[1] ** 2
    turns = ((directions[0] - directions[1]) ** 2 / variance)[np.isfinite(variance)]
    return Halves(
        scales,
        float(places.sum() + scales.sum()) / (2 * len(places) + len(scales)),
        float(turns.mean()) if len(turns) else 1.0,
        abs(half_angles[0] - half_angles[1]),
    )


def _first_guess(
    drive: Drive,
    echoes: Echoes,
    nominal: Floats,
    inside: float,
    ring_half_angle: float,
    radii: Sequence[float],
    way_m: float | None,
    *,
    synchro: bool,
) -> Geometry | None:
    """Return scales and surfaces near the best ones, with the nominal mounts; None if there are no surfaces.

    Where everything in a beam echoes, a wall looks as sharp under a turn scale that is a few percent wrong, and a fit
    from there ends in a wrong minimum. So a rough fit begins at each of a few, and that which explains most readings
    wins.
    """
    bends = np.zeros(drive.knots)
    few = echoes.chosen(slice(None, None, 1 + len(echoes.sensor) // FIT_ECHOES_MAX))

    def beams(turn: float, readings: Echoes) -> Beams:
        path = drive.path(Scales(turn=turn), bends, synchro=synchro)
        return sensors_at(path, readings, nominal[:, :2], nominal[:, 2])

    def sharpness(turn: float) -> int:
        return most_voted_wall(beams(turn, few), few.range_m, ring_half_angle)[0]

    tried: list[float] = []
    for turn in sorted(TURN_SCALES, key=sharpness, reverse=True):
        if all(abs(turn - other) >= TURN_STARTS_APART for other in tried):
            tried.append(turn)
    best: tuple[float, Geometry] | None = None
    for turn in tried[:TURN_STARTS]:
        surfaces = find_surfaces(beams(turn, echoes), echoes.range_m, ring_half_angle, WALLS_MAX, radii)
        count = len(surfaces.walls) + len(surfaces.drums)
        if not count:
            continue
        start = Geometry(Scales(turn=turn), surfaces, nominal[:, :2], bends)
        rough = fit_geometry(drive, few, nominal[:, 2], inside, start, PRIORS, way_m, synchro=synchro)
        explained, fitted = float(rough.readings.sum()) - SURFACE_SHARE * len(few.sensor) * count, rough.geometry
        if best is None or explained > best[0]:
            drums = np.column_stack([fitted.surfaces.drums[:, :2], surfaces.drums[:, 2]])
            found = Surfaces(fitted.surfaces.walls, drums)
            best = explained, Geometry(fitted.scales, found, nominal[:, :2], bends)
    return best[1] if best is not None else None


def _looks(drive: Drive, fit: GeometryFit, angles: Floats, *, synchro: bool) -> Looks:
    """Return the readings of sensors that have a surface near their beam, and hear nothing nearer."""
    firing, sensor = np.nonzero(~np.isnan(drive.ranges))
    fired = Echoes(firing, sensor, drive.ranges[firing, sensor])
    geometry = fit.geometry
    path = drive.path(geometry.scales, geometry.bends, synchro=synchro)
    beams = sensors_at(path, fired, geometry.mounts, angles)
    distance, bearing = geometry.surfaces.distances(beams.x, beams.y)
    turned = np.remainder(bearing - beams.axis + math.pi, 2.0 * math.pi) - math.pi
    read = fired.range_m / geometry.scales.range
    tolerance = GATE_SIGMAS * fit.noise.sigmas(distance)
    answered = np.abs(read - distance) < tolerance
    near = (np.abs(turned) < LOOK_MAX_RAD) & (distance > 0.0)
    near &= (read > distance - tolerance) & (distance < LISTENED_SHARE * np.max(read[np.isfinite(read)]))
    for k, angle in enumerate(geometry.surfaces.walls[:, 0].tolist()):
        # A wall ends somewhere: beyond the echoes that it gave in the middle of the beams, silence means nothing.
        along = math.cos(angle) * beams.y - math.sin(angle) * beams.x
        sure = along[answered[k] & near[k] & (np.abs(turned[k]) < SURE_RAD)]
        near[k] &= (along > np.min(sure, initial=math.inf)) & (along < np.max(sure, initial=-math.inf))
    surface, look = np.nonzero(near)
    walls = np.full(len(geometry.surfaces.walls), np.inf)
    radii = np.concatenate([walls, geometry.surfaces.drums[:, 2]])
    d = distance[surface, look]
    return Looks(fired.sensor[look], turned[surface, look], d, radii[surface], read[look], fit.noise.sigmas(d))


def _shown(
    fit: GeometryFit, beams: BeamFit, turn_sigmas: Floats, halves: Halves, nominal: Floats, half_angle: float
) -> Calibration:
    """Return what the drive shows, with nominal values for what it does not show.

    The places of sensors in the ring follow from its turns: where the turn's scale is not shown, no place is. A turn
    on the spot shows those of all sensors alike, so what shows those of fewer than half of them is chance.
    """
    geometry = fit.geometry
    sigmas = np.array(fit.scale_sigmas) * np.sqrt(np.maximum(1.0, np.maximum(halves.scales, halves.places)))
    place_sigmas = fit.mount_sigmas_m * math.sqrt(max(1.0, halves.places))
    # A beam's axis lies between its edges: what moves an edge moves the axis as far as the half angle.
    turn_sigmas = np.hypot(turn_sigmas * math.sqrt(max(1.0, halves.directions)), 0.5 * halves.half_angle)
    is_shown = sigmas <= SCALE_SHOWN * PRIORS.scale
    has_place = (place_sigmas <= PLACE_SHOWN * PRIORS.mount_m) & (fit.readings > 0) & is_shown[1]
    has_place &= 2 * int(has_place.sum()) >= len(nominal)
    has_angle = has_place & np.isfinite(turn_sigmas)
    mounts = nominal.copy()
    is_elsewhere = _is_gain(geometry.mounts - nominal[:, :2], place_sigmas, has_place)
    is_turned = _is_gain(beams.turns[:, None], turn_sigmas, has_angle)
    mounts[is_elsewhere, :2] = geometry.mounts[is_elsewhere]
    mounts[is_turned, 2] += beams.turns[is_turned]
    least = max(HALF_ANGLE_STEP_RAD, halves.half_angle)
    is_wider = has_angle.any() and abs(beams.half_angle - half_angle) > least
    changes = np.array(geometry.scales)[:, None] - 1.0
    is_scaled = [_is_gain(changes[i : i + 1], sigmas[i : i + 1], is_shown[i : i + 1])[0] for i in range(3)]
    return Calibration(
        mounts,
        np.where(has_place, place_sigmas, np.inf),
        np.where(has_angle, turn_sigmas, np.inf),
        fit.readings,
        beams.half_angle if is_wider else half_angle,
        beams.everything_echoes,
        Scales(*(value if taken else 1.0 for value, taken in zip(geometry.scales, is_scaled, strict=True))),
        Scales(*np.where(is_shown, sigmas, math.inf).tolist()),
        fit.noise,
        len(geometry.surfaces.walls),
        len(geometry.surfaces.drums),
        bool(is_wider or is_elsewhere.any() or is_turned.any() or any(is_scaled)),
    )


def _is_gain(change: Floats, sigma: Floats, shown: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which changes (shape (n, k)) of one kind bring values nearer to the truth than the nominal ones are.

    A fit is off by kσ² in the mean square, and the nominal value by what the change's square exceeds kσ² (Akaike's
    criterion). None is taken over if noise alone explains all that are shown: if the sum of their squares exceeds it
    in more than 1 of 1,000 drives (Wilson and Hilferty's approximation). `sigma` is that of each component, shape
    (n,).
    """
    ratio = (change**2).sum(axis=1) / sigma**2
    components = change.shape[1]
    freedom = components * int(shown.sum())
    if freedom == 0:
        return shown
    spread = 2.0 / (9.0 * freedom)
    noise = freedom * (1.0 - spread + CHANCE_SIGMAS * math.sqrt(spread)) ** 3
    found: NDArray[np.bool_] = shown & (ratio > 2.0 * components) & bool(ratio[shown].sum() > noise)
    return found
