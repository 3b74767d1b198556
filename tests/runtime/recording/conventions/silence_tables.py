"""Tables whose silence is hard to see: noisy ceilings, and walls along a straight way that look like one."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from config.load import load_settings
from config.settings import Settings
from config.world import AcousticsConfig, WallConfig, WorldConfig
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.firing_pattern import firing_pattern, sensors
from drivers.messages import Floats, Pose
from runtime.recording.conventions.decision import decide
from runtime.recording.conventions.headings import Angles
from runtime.recording.conventions.options import AUTO
from runtime.recording.conventions.table import Table
from runtime.recording.conventions.units import Units
from runtime.recording.ring_log import RingLogError
from tests.runtime.recording.conventions.tables import MODELS, ROBOTS, WORLDS, make_drive

KINDS: Final = ("clipped", "rare", "exact", "noisy-corridor", "sway", "heard", "maxima")
DRIVE_S: Final = 60.0
RARE: Final = (0.03, 0.06)
"""Least and greatest share of silence that is rare."""


@dataclass(frozen=True)
class SilenceTable:
    """A table in the form's own conventions but for silence, and what is true of it."""

    settings: Settings
    table: Table
    is_silent: NDArray[np.bool_]


def silence_table(kind: str, seed: int) -> SilenceTable:
    """Return the table of a kind and a seed."""
    rng = np.random.default_rng([seed, KINDS.index(kind), 138])
    robot = str(rng.choice(np.array(ROBOTS)))
    if kind in {"exact", "noisy-corridor", "sway"}:
        return _corridor(rng, robot, kind)
    world, model = str(rng.choice(np.array(WORLDS))), str(rng.choice(np.array(MODELS)))
    drive = make_drive(seed + 20_000, robot, world, model, DRIVE_S)
    ranges, silent = drive.ranges.copy(), np.isinf(drive.ranges)
    top = drive.settings.ring.range_max_m
    decimals = int(rng.integers(2, 4))
    n = int(silent.sum())
    if kind == "clipped":  # values pile up at the greatest one
        spread = float(rng.uniform(0.004, 0.025)) * top
        ceiling = top - float(rng.uniform(-0.5, 1.5)) * spread
        ranges[silent] = np.minimum(ceiling + spread * rng.standard_normal(n), top)
    elif kind == "rare":
        share = float(rng.uniform(*RARE))
        fired = int(np.isfinite(ranges).sum())
        keep = min(1.0, share * fired / max(n, 1))
        dropped = silent & (rng.random(silent.shape) > keep)
        ranges[dropped], silent = np.nan, silent & ~dropped
        spread = float(rng.uniform(0.02, 0.08))
        ranges[silent] = top - 2.0 * spread + spread * rng.standard_normal(int(silent.sum()))
    elif kind == "maxima":
        ranges[silent] = round(top, decimals)
    else:
        ranges[silent], silent = np.nan, np.zeros_like(silent)
    rounded: Floats = np.round(ranges, decimals)
    return SilenceTable(drive.settings, Table(drive.t, drive.pose, rounded), silent)


def _corridor(rng: np.random.Generator, robot: str, kind: str) -> SilenceTable:
    """Return a drive up and down a corridor: exactly along it without or with noise, or swaying by 5 cm."""
    settings = load_settings("hallway", robot=robot, models=("drum",))
    ring = settings.ring
    model = str(rng.choice(np.array(MODELS)))
    acoustics = AcousticsConfig(
        model="cone" if model == "cone" else "specular", noise_relative=0.0,
        noise_m=0.0 if kind == "exact" else float(rng.uniform(0.002, 0.02)), dropout=float(rng.choice([0.0, 0.03])),
    )  # fmt: skip
    left, right = (float(d) for d in rng.uniform(settings.body.radius_m + 0.3, 2.8, 2))
    if rng.random() < 0.3:
        right = left  # in the middle
    length = float(rng.uniform(6.0, 30.0))
    walls = [WallConfig(x1_m=-3.0, y1_m=y, x2_m=length, y2_m=y) for y in (left, -right)]
    if rng.random() < 0.5:  # closed ends
        walls += [WallConfig(x1_m=x, y1_m=-right, x2_m=x, y2_m=left) for x in (-3.0, length)]
    period = max(ring.firing.step_period_s, 0.02)
    rows = int(DRIVE_S / period)
    way = float(rng.uniform(0.15, 0.35)) * period * np.arange(rows)
    span = length - 3.0
    x = span - np.abs(span - way % (2.0 * span))
    back = way % (2.0 * span) > span
    sway = 0.05 if kind == "sway" else 0.0
    wave = float(rng.uniform(1.0, 4.0))
    y, slope = sway * np.sin(way / wave), sway / wave * np.cos(way / wave)
    theta = np.where(back, math.pi - np.arctan(slope), np.arctan(slope))
    yaw = np.zeros(rows) if settings.body.synchro else theta
    sonar = Sonar(ring, compile_scene(WorldConfig(wall=tuple(walls), acoustics=acoustics)), acoustics, rng)
    masks = firing_pattern(ring).masks
    ranges = np.array([
        sonar.fire(Pose(*p), w, sensors(masks[k % len(masks)]))
        for k, (p, w) in enumerate(zip(np.column_stack([x, y, theta]).tolist(), yaw.tolist(), strict=True))
    ])  # fmt: skip
    silent = np.isinf(ranges)
    if rng.random() < 0.5:
        ranges[silent] = ring.range_max_m
    else:
        ranges[silent], silent = np.nan, np.zeros_like(silent)
    pose: Floats = np.column_stack([x, y, theta, yaw])
    rounded: Floats = np.round(ranges, int(rng.integers(2, 5)))
    t: Floats = period * np.arange(rows, dtype=np.float64)
    return SilenceTable(settings, Table(t, pose, rounded), silent)


def outcome(case: SilenceTable) -> tuple[str, str]:
    """Return what becomes of a table without options, and the words for it.

    It is right, refused for its silence, refused as something else is unclear, or wrong: a tenth of
    what is silent is taken for echoes, or far more values are taken wrongly than by the best interval.
    """
    try:
        found = decide(case.table, case.settings, AUTO)
    except RingLogError as error:
        return ("refused" if "--silence" in str(error) else "unclear"), str(error)
    if found.units != Units() or found.angles != Angles() or found.columns is not None:
        return "wrong", f"{found.said}"
    ranges = case.table.ranges
    got, fired = np.isposinf(found.silence.applied(ranges)), ~np.isnan(ranges)
    missed, silenced = int((case.is_silent & ~got).sum()), int((got & ~case.is_silent & fired).sum())
    counts = f"{case.is_silent.sum()} of {fired.sum()} silent, {missed} missed, {silenced} echoes silenced"
    allowed = 1.3 * _least_wrong(ranges[fired], case.is_silent[fired]) + 0.005 * fired.sum()
    is_right = missed <= max(0.1 * case.is_silent.sum(), 0.005 * fired.sum()) and missed + silenced <= allowed
    return ("right" if is_right else "wrong"), f"{counts}; {found.said}"


def _least_wrong(ranges: Floats, is_silent: NDArray[np.bool_]) -> int:
    """Return how many values the best interval takes wrongly."""
    order = np.argsort(ranges, kind="stable")
    gain = np.cumsum(np.where(is_silent[order], 1, -1))
    best = float((gain - np.minimum.accumulate(np.r_[0, gain[:-1]])).max(initial=0))
    return int(is_silent.sum() - best)
