"""What any filter could know of the drums as seen from a robot whose odometry drifts: a filter that knows the rest.

A particle filter knows the noise, the walk of the heading, and either the drums' places and the scales, or those that
the program found in the same drive. Each reading has its exact probability by the emulator's model: drop-outs, wild
readings, noise, rounding, and a beam that ends sharply.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from statistics import mean, stdev
from typing import Final, NamedTuple

import numpy as np

from bench.correction_drives import level_name
from config.settings import LocalizationConfig, Settings
from config.units import FOOT_M
from config.world import OdometryConfig
from drivers.messages import Firing, Floats, Pose
from perception.kernel import kernel
from perception.localization.map_frame import MapFrame
from perception.pipeline import Perception
from perception.sensor_mounts import mounts_array
from runtime.simulation.drift_trials import LEVELS, RADIUS_FT, drum_hall, firings, oval
from runtime.simulation.open_loop import perceive
from runtime.simulation.random_halls import ACOUSTICS

PARTICLES: Final = 1000
RADIUS_M: Final = RADIUS_FT * FOOT_M
FOUND_START: Final = (0.03, 0.03, 0.03)
"""Standard deviations of the start (m, m, rad) in a map that was found."""
ROOT2: Final = math.sqrt(2.0)


class Known(NamedTuple):
    """What a filter is given."""

    drums: Floats
    """Places, m, shape (n, 2)."""
    range_scale: float
    odometer_scale: float
    start_sigma: tuple[float, float, float]
    """Of x, y (m) and heading (rad) at the start."""


@kernel
def first_range(x: float, y: float, axis: float, drums: Floats, radius: float, half_angle: float) -> float:
    """Return the distance (m) of the first drum that answers a sensor at (x, y), axis in rad; inf for none."""
    ax, ay, best, inside = math.cos(axis), math.sin(axis), math.inf, math.cos(half_angle)
    for k in range(len(drums)):
        cx, cy = drums[k, 0] - x, drums[k, 1] - y
        d = math.sqrt(cx * cx + cy * cy)
        if d - radius >= best or cx * ax + cy * ay < d * inside:
            continue
        is_hidden = False
        for j in range(len(drums)):
            ox, oy = drums[j, 0] - x, drums[j, 1] - y
            along = (ox * cx + oy * cy) / d
            is_hidden = is_hidden or (j != k and 0.0 < along < d - radius and abs(ox * cy - oy * cx) < radius * d)
        if not is_hidden:
            best = d - radius
    return best


@kernel
def weigh(
    particles: Floats, weights: Floats, mount: Floats, r: float, drums: Floats, scale: float, ring: Floats,
    acoustics: Floats,
) -> None:  # fmt: skip
    """Multiply the weights by the probability of a reading.

    Parameters
    ----------
    particles : (n, 3) float
        x, y (m), heading (rad).
    weights : (n,) float
        Updated.
    mount : (3,) float
        Of the sensor: x, y (m), direction (rad).
    r : float
        Range, m; inf: no echo.
    drums : (m, 2) float
        Places, m.
    scale : float
        Reported range over true range.
    ring : (5,) float
        Drums' radius (m), half the beam's width (rad), resolution, least and greatest range (m).
    acoustics : (4,) float
        Relative noise, share of drop-outs, share of wild readings, and their greatest range, m.
    """
    radius, half_angle, resolution, range_min, window = ring
    noise, dropout, wild, farthest = acoustics
    by_chance = 0.0 if r > farthest else wild * resolution / (farthest - range_min)
    for i in range(len(particles)):
        c, s = math.cos(particles[i, 2]), math.sin(particles[i, 2])
        x = particles[i, 0] + c * mount[0] - s * mount[1]
        y = particles[i, 1] + s * mount[0] + c * mount[1]
        expected = scale * first_range(x, y, particles[i, 2] + mount[2], drums, radius, half_angle)
        if expected > window:
            weights[i] *= 1.0 - wild if math.isinf(r) else by_chance
        elif math.isinf(r):
            weights[i] *= (1.0 - wild) * dropout
        else:
            sigma = ROOT2 * noise * expected
            above = math.erf((r + 0.5 * resolution - expected) / sigma)
            below = -1.0 if r <= range_min else math.erf((r - 0.5 * resolution - expected) / sigma)
            weights[i] *= by_chance + (1.0 - wild) * (1.0 - dropout) * 0.5 * (above - below)


def follow(settings: Settings, drive: Sequence[Firing], known: Known, walk: float, rng: np.random.Generator) -> Pose:
    """Return the mean pose at the end of a drive.

    Parameters
    ----------
    settings
        The ring.
    drive
        The firings, of a ring that turns with the wheels.
    known
        What the filter is given.
    walk
        Of the heading by odometry, rad per √m.
    rng
        Source of the particles' random numbers.
    """
    ring, mounts = settings.ring, mounts_array(settings.ring.mounts)
    of_ring = np.array([
        RADIUS_M, math.radians(ring.beam_half_angle_deg), ring.resolution_m, ring.range_min_m, ring.window_m,
    ])  # fmt: skip
    wild_m = ring.window_m if ACOUSTICS.outlier_max_m is None else ACOUSTICS.outlier_max_m
    of_echoes = np.array([ACOUSTICS.noise_relative, ACOUSTICS.dropout, ACOUSTICS.outliers, wild_m])
    start = drive[0].pose
    particles = np.array([start.x, start.y, start.theta]) + known.start_sigma * rng.standard_normal((PARTICLES, 3))
    weights = np.full(PARTICLES, 1.0 / PARTICLES)
    for before, firing in itertools.pairwise([drive[0], *drive]):
        step = before.pose.inverse().compose(firing.pose)
        x, y = step.x / known.odometer_scale, step.y / known.odometer_scale
        wander = walk * math.sqrt(math.hypot(x, y)) * rng.standard_normal(PARTICLES)
        c, s = np.cos(particles[:, 2] - 0.5 * wander), np.sin(particles[:, 2] - 0.5 * wander)
        particles += np.column_stack([c * x - s * y, s * x + c * y, step.theta - wander])
        for i in np.flatnonzero(~np.isnan(firing.ranges_m)).tolist():
            r = float(firing.ranges_m[i])
            weigh(particles, weights, mounts[i], r, known.drums, known.range_scale, of_ring, of_echoes)
        weights /= weights.sum()
        if 1.0 / float(weights @ weights) < 0.5 * PARTICLES:
            at = (np.arange(PARTICLES) + rng.random()) / PARTICLES
            particles = particles[np.minimum(np.searchsorted(np.cumsum(weights), at), PARTICLES - 1)]
            weights = np.full(PARTICLES, 1.0 / PARTICLES)
    end = weights @ particles
    return Pose(float(end[0]), float(end[1]), float(end[2]))


def seen_from(pose: Pose, drums: Floats) -> Floats:
    """Return places (m), shape (n, 2), as seen from a pose."""
    c, s = math.cos(pose.theta), math.sin(pose.theta)
    seen: Floats = (drums - (pose.x, pose.y)) @ np.array([[c, -s], [s, c]])
    return seen


def errors_of(settings: Settings, errors: OdometryConfig, seed: int) -> dict[str, float]:
    """Return the mean error of a drum at the end of a drive, m, by what the filter was given, and the program's."""
    world, path = drum_hall(seed), oval()
    drive = list(firings(settings, world, path, errors, seed, synchro=False))
    drums = np.array([(drum.x_m, drum.y_m) for drum in world.drum])
    true = seen_from(path[-1], drums)
    config = settings.perception.model_copy(update={"localization": LocalizationConfig(correct_drift=True)})
    perception = Perception(settings.ring, settings.models, config)
    for firing in drive:
        perceive(perception, firing)
    localized = perception.localized()
    assert localized is not None
    assert isinstance(perception.map_frame, MapFrame)
    estimate = perception.map_frame.drift.e[0]
    objects = np.array([(one.x, one.y) for one in perception.mapped_objects()]).reshape(-1, 2)
    own = seen_from(localized.pose, objects)
    nearest = np.argmin(np.linalg.norm(true[:, None] - own, axis=2), axis=1)
    found = objects[nearest]
    sound = world.acoustics.sound_speed_scale
    given = {
        "the truth": Known(drums, 1.0 / sound, errors.scale, (0.0, 0.0, 0.0)),
        "what ours found": Known(found, estimate.range_scale, estimate.odometer_scale, FOUND_START),
    }
    rows = {"ours": float(np.mean(np.linalg.norm(own[nearest] - true, axis=1)))}
    for name, known in given.items():
        rng = np.random.default_rng(np.random.SeedSequence([seed, 8]))
        end = follow(settings, drive, known, errors.heading_rad_per_sqrt_m, rng)
        rows[name] = float(np.mean(np.linalg.norm(seen_from(end, known.drums) - true, axis=1)))
    return rows


def measure(
    settings: Settings, seeds: Iterable[int], report: Callable[[str], None]
) -> dict[str, dict[str, float]]:  # fmt: skip
    """Return the mean error of a drum, ft, and its standard error, by level of odometry's errors.

    Parameters
    ----------
    settings
        Ring, models and perception.
    seeds
        Which drives, at least two.
    report
        Called with a line on what is running.
    """
    seeds, rows = tuple(seeds), {}
    for errors in LEVELS[1:]:
        level = level_name(errors)
        drives = []
        for seed in seeds:
            report(f"drift-bound: {level}, drive {seed}")
            drives.append(errors_of(settings, errors, seed))
        row: dict[str, float] = {"drives": len(seeds)}
        for name in drives[0]:
            values = [drive[name] / FOOT_M for drive in drives]
            row |= {name: mean(values), f"{name}, ±": stdev(values) / math.sqrt(len(values))}
        rows[level] = row
    return rows
