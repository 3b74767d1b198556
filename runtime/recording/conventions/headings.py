"""How a ring log counts its headings, by the robot's motion and by what the ranges agree on.

Along its way a robot looks forward or back, so the directions of the steps show the unit of theta, its sense and
where it counts from. A mirrored frame shows in nothing but the ranges: under the true convention later echoes fall
where earlier ones did, and under any other they spread. The log density of earlier echoes about each later one
is compared between conventions in blocks of time, whose spread says how sure the difference is.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from config.robot import RobotConfig
from drivers.messages import Floats
from runtime.recording.conventions.options import RingLogOptions
from runtime.recording.conventions.table import ANGLES, HEADINGS, HeadingRule, Table

STEPS: Final = 400
"""Steps of the way in which directions are compared."""
STEPS_MIN: Final = 20
SPREAD_RAD: Final = 0.15
"""Spread of a step's direction about the heading: slip, and the bend of a step."""
NEAR_NAT: Final = 20.0
"""Conventions whose motion is less likely by this are left to the ranges only if they are the form's own."""
LEAP: Final = 10.0
"""A step longer than the median one by this counts as one of this length: odometry leaps."""
RELATED_NAT: Final = 0.5
"""Gain a step over random directions, from which the motion is along the heading at all. A robot that drives sideways
as often as forward has none."""
TURNS: Final = 72
"""Angles at which directions may follow theta that are looked at: each is off by less than their spread."""
ECHOES: Final = 1500
ROWS: Final = 128
"""Echoes that are compared with those before them at a time: few enough for the processor's cache."""
BLOCKS: Final = 20
KERNEL_M: Final = 0.15
"""Width of an echo's density, m: what a beam leaves open at a metre or two."""
FAR: Final = 1e9
"""Greatest distance in widths of the density: its cube is a number in single precision."""
SURE: Final = 4.5
"""Standard errors by which a convention must explain the echoes better. Over 20 clean drives, the mirrored one was
worse by 8 at least."""


class Angles(NamedTuple):
    """A convention of the angles by name."""

    heading: str = "ccw"
    unit: str = "rad"

    @property
    def options(self) -> str:
        """The options that set it."""
        return f"--heading {self.heading} --angle-unit {self.unit}"

    @property
    def words(self) -> str:
        """What it means."""
        return f"{HEADINGS[self.heading].words}, in {'degrees' if self.unit == 'deg' else 'radians'}"

    def yaw(self, angles: Floats) -> Floats:
        """Return angles of the file in radians, counter-clockwise in the frame of x and hand · y."""
        return HEADINGS[self.heading].angles(ANGLES[self.unit] * angles)


def opposite(one: Angles) -> Angles:
    """Return the convention under which the robot looks the other way."""
    rule = HEADINGS[one.heading]
    return _named(one, rule._replace(offset_rad=rule.offset_rad + math.pi))


def mirror_image(one: Angles) -> Angles:
    """Return the convention that looks the same if the ring is mirrored: the same angles, y on the other side."""
    rule = HEADINGS[one.heading]
    return _named(one, rule._replace(hand=-rule.hand))


def _named(one: Angles, wanted: HeadingRule) -> Angles:
    """Return angles with the name of the heading that follows this rule."""
    for name, rule in HEADINGS.items():
        is_from_there = math.isclose(math.cos(rule.offset_rad - wanted.offset_rad), 1.0)
        if is_from_there and (rule.turn, rule.hand) == (wanted.turn, wanted.hand):
            return one._replace(heading=name)
    raise ValueError(one.heading)  # all turns, quarters and hands have a name


class Motion(NamedTuple):
    """What the directions of the way say about each convention."""

    scores: dict[Angles, float]
    """Log-likelihoods, against any direction being as likely."""
    is_known: bool
    """Whether the robot moved enough."""
    is_related: bool
    """Whether the directions follow theta at all."""
    turned: tuple[Angles, float] | None = None
    """A convention, and the angle (rad, in the file's frame) by which the directions are off from it, where they
    follow theta at an angle that no convention has."""


def motion_scores(table: Table, options: RingLogOptions) -> Motion:
    """Return how well each convention explains the directions of the way.

    Parameters
    ----------
    table : Table
        In the file's units.
    options : RingLogOptions
        What is known.
    """
    headings = list(HEADINGS) if options.heading == "auto" else [options.heading]
    units = list(ANGLES) if options.angle_unit == "auto" else [options.angle_unit]
    choices = [Angles(heading, unit) for heading in headings for unit in units]
    directions, angles = _directions(table)
    if len(directions) < STEPS_MIN:
        return Motion(dict.fromkeys(choices, 0.0), is_known=False, is_related=False)

    def score(one: Angles, offset_rad: float) -> float:
        return _direction_score(
            directions - HEADINGS[one.heading].turn * _middle(ANGLES[one.unit] * angles) - offset_rad
        )

    scores = {one: score(one, HEADINGS[one.heading].offset_rad) for one in choices}
    best = max(scores.values())
    turned = None
    if options.heading == "auto":
        offsets = np.linspace(-math.pi, math.pi, TURNS, endpoint=False)
        alone = max(_direction_score(directions - offset) for offset in offsets)
        found = {
            (one, offset): score(one, offset) for one in choices if one.heading in {"ccw", "cw"} for offset in offsets
        }
        likely = max(found, key=found.__getitem__)
        if found[likely] > max(best, alone, RELATED_NAT * len(directions)) + NEAR_NAT:
            turned = likely[0], float(likely[1])
    return Motion(scores, is_known=True, is_related=best > RELATED_NAT * len(directions), turned=turned)


def _directions(table: Table) -> tuple[Floats, Floats]:
    """Return the directions of steps of equal length, (n,), and the angles of the file at their ends, (n, 2)."""
    x, y, theta = table.pose[:, 0], table.pose[:, 1], table.pose[:, 2]
    steps = np.hypot(np.diff(x), np.diff(y))
    if not steps.any():
        return np.empty(0), np.empty((0, 2))
    steps = np.minimum(steps, LEAP * np.median(steps[steps > 0.0]))
    way = np.concatenate([[0.0], np.cumsum(steps)])
    a = np.unique(np.searchsorted(way, np.linspace(0.0, way[-1], STEPS, endpoint=False)))
    a, b = a[:-1], a[1:]
    dx, dy = x[b] - x[a], y[b] - y[a]
    moved = np.hypot(dx, dy) > 0.5 * way[-1] / STEPS
    return np.arctan2(dy, dx)[moved], np.column_stack([theta[a], theta[b]])[moved]


def _middle(angles: Floats) -> Floats:
    """Return the angles half way between two, rad."""
    middle: Floats = angles[:, 0] + 0.5 * np.angle(np.exp(1j * (angles[:, 1] - angles[:, 0])))
    return middle


def _direction_score(off: Floats) -> float:
    """Return the log-likelihood of directions by how far they are off the heading, rad."""
    off = np.abs(np.angle(np.exp(1j * off)))
    fits = np.exp(-0.5 * (off / SPREAD_RAD) ** 2) + 0.3 * np.exp(-0.5 * ((math.pi - off) / SPREAD_RAD) ** 2)
    density = 0.8 * fits / (1.3 * SPREAD_RAD * math.sqrt(2.0 * math.pi)) + 0.2 / math.pi
    return float(np.log(density * math.pi).sum())


def echo_scores(
    table: Table,
    robot: RobotConfig,
    choices: list[Angles],
    mounts_per_unit: float,
    length_per_range: float,
    kernel_m: float = KERNEL_M,
    echoes: int = ECHOES,
) -> dict[Angles, Floats]:
    """Return how well earlier echoes explain later ones under each convention, in blocks of time.

    Parameters
    ----------
    table : Table
        In the file's units, without silence and repeats.
    robot : RobotConfig
        Its ring.
    choices : list of Angles
        The conventions.
    mounts_per_unit : float
        The unit of the ranges, m.
    length_per_range : float
        The unit of positions over that of ranges.
    kernel_m : float
        Width of an echo's density.
    echoes : int
        Most echoes that are compared.
    """
    rows, sensors = np.nonzero(np.isfinite(table.ranges))
    if len(rows) < 4 * BLOCKS:
        return {one: np.zeros(BLOCKS) for one in choices}
    if len(rows) > echoes:
        chosen = np.random.default_rng(0).choice(len(rows), echoes, replace=False)
        chosen.sort()
        rows, sensors = rows[chosen], sensors[chosen]
    mounts = np.array(robot.ring.mounts)[sensors]
    reach = mounts_per_unit * table.ranges[rows, sensors]
    poses = from_middle(table.pose)[rows]
    scores = {}
    for one in choices:
        px, py = echo_places(poses, one, mounts, reach, mounts_per_unit * length_per_range)
        near = np.empty(len(px))
        for begin in range(0, len(px), ROWS):  # those before it and, of its own, the earlier ones
            end = begin + ROWS
            part = nearness(px[begin:end], py[begin:end], px[:end], py[:end], kernel_m)
            part[:, begin:] = np.tril(part[:, begin:], -1)
            near[begin:end] = part.sum(axis=1)
        density = near[1:] / np.arange(1, len(px))
        tail = np.log(density + 1e-3)[len(px) // 10 :]
        scores[one] = np.array([block.mean() for block in np.array_split(tail, BLOCKS)])
    return scores


def from_middle(pose: Floats) -> Floats:
    """Return poses with x and y counted from their median, near which single precision is exact enough.

    Parameters
    ----------
    pose : (rows, 4) float
        In the file's units.
    """
    moved = pose.copy()
    moved[:, :2] -= np.median(pose[:, :2], axis=0)
    return moved


def nearness(px: Floats, py: Floats, x: Floats, y: Floats, kernel_m: float) -> NDArray[np.float32]:
    """Return how near each place is to each other one, (1 + d²/w²)^-3/2, (places, others); 1 where they are one.

    It takes nearly all of the time, and in single precision a sixth of that in double: sums of a thousand differ by
    1e-6 of themselves.

    Parameters
    ----------
    px, py : (places,) float
        m, counted from where the robot was: see `from_middle`.
    x, y : (others,) float
        m.
    kernel_m : float
        Width w of an echo's density.
    """
    px1, py1, x1, y1 = (np.clip(each / kernel_m, -FAR, FAR).astype(np.float32) for each in (px, py, x, y))
    spread, across = np.subtract.outer(px1, x1), np.subtract.outer(py1, y1)
    spread *= spread
    across *= across
    spread += across
    spread += np.float32(1.0)
    spread *= np.sqrt(spread, out=across)
    return np.reciprocal(spread, out=spread)


def echo_places(poses: Floats, one: Angles, mounts: Floats, reach: Floats, scale: float) -> tuple[Floats, Floats]:
    """Return x and y of echoes on the axes of their sensors, m.

    Parameters
    ----------
    poses : (echoes, 4) float
        In the file's units.
    one : Angles
        How headings are counted.
    mounts : (echoes, 3) float
        Of the sensors; axes before may broadcast.
    reach : (echoes,) float
        Ranges, m.
    scale : float
        The unit of positions, m.
    """
    yaw = one.yaw(poses[:, 3])
    x, y = scale * poses[:, 0], scale * HEADINGS[one.heading].hand * poses[:, 1]
    c, s, bearing = np.cos(yaw), np.sin(yaw), yaw + mounts[..., 2]
    px = x + c * mounts[..., 0] - s * mounts[..., 1] + reach * np.cos(bearing)
    py = y + s * mounts[..., 0] + c * mounts[..., 1] + reach * np.sin(bearing)
    return px, py


def sureness(better: Floats, worse: Floats) -> float:
    """Return by how many standard errors one convention explains the echoes better than another; 0 if equally.

    Parameters
    ----------
    better, worse : (blocks,) float
        Of `echo_scores`.
    """
    gain = better - worse
    error = float(gain.std(ddof=1)) / math.sqrt(len(gain))
    return 0.0 if abs(float(gain.mean())) < 0.01 else float(gain.mean()) / max(error, 1e-9)
