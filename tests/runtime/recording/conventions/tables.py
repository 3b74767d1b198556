"""Tables as other programs write them: a drive under any convention of heading, unit, silence and latching."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Final, Literal

import numpy as np

from config.load import load_settings
from config.settings import Settings
from config.units import FOOT_M
from config.world import AcousticsConfig, DrumConfig, WallConfig, WorldConfig
from drivers.emulator.acoustics import clearance
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.firing_pattern import firing_pattern, sensors
from drivers.messages import Floats, Pose
from runtime.recording.conventions.sensor_order import mirrored_columns
from runtime.recording.conventions.table import HEADINGS
from runtime.simulation.drift_trials import oval

ROBOTS: Final = ("p3dx", "denning", "p3at", "amigo", "magellan")
WORLDS: Final = ("room", "hall")
MODELS: Final = ("cone", "specular")
ANGLES: Final = {"rad": 1.0, "deg": 180.0 / math.pi}
LENGTHS: Final = {"m": 1.0, "cm": 100.0, "mm": 1000.0, "in": 1.0 / 0.0254, "ft": 1.0 / FOOT_M}
TIMES: Final = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}
HEADING_NAMES: Final = ("ccw", "cw", "north-cw", "north-ccw", "y-down", "left-handed", "sensors-cw")
RARE_HEADINGS: Final = tuple(sorted(HEADINGS.keys() - set(HEADING_NAMES)))
NOT_FIRED: Final = ("0", "-1", "nan", "inf")
"""In place of empty cells."""
SILENCES: Final = ("inf", "zero", "max", "noisy-max", "glitch-max", "-1", "999", "65535", "255", "nan")
Wrapped = Literal["no", "signed", "positive"]
DRIVE_S: Final = 150.0
ROW_S: Final = 0.1
"""Rows of latched tables are this far apart."""


@dataclass(frozen=True)
class Drive:
    """A drive in the shared convention: metres, radians, seconds; one row a firing."""

    robot: str
    world: WorldConfig
    settings: Settings
    t: Floats
    pose: Floats
    """(n, 4): x, y, theta, ring_yaw."""
    ranges: Floats
    """(n, sensors): NaN did not fire, inf heard nothing."""


@dataclass(frozen=True)
class Convention:
    """How a table is written."""

    heading: str = "ccw"
    angle: str = "rad"
    wrapped: Wrapped = "no"
    position: str = "m"
    range_: str = "m"
    time: str = "s"
    silence: str = "inf"
    latched: bool = False
    decimals: int = 4
    not_fired: str = ""
    mirrored: bool = False
    shift: int = 0
    """The column of the robot file's first sensor."""
    order: tuple[int, ...] = ()
    """The sensor of each column, where columns are exchanged."""


def _room(rng: np.random.Generator, acoustics: AcousticsConfig) -> tuple[WorldConfig, tuple[float, float]]:
    """Return a closed or partly open room with two to four drums, and its half sizes."""
    a, b = float(rng.uniform(3.0, 4.8)), float(rng.uniform(2.8, 4.0))
    corners = [(-a, -b), (a, -b), (a, b), (-a, b)]
    walls = []
    for (x1, y1), (x2, y2) in zip(corners, [*corners[1:], corners[0]], strict=True):
        if rng.random() < 0.3:
            x2, y2 = x1 + 0.6 * (x2 - x1), y1 + 0.6 * (y2 - y1)
        walls.append(WallConfig(x1_m=x1, y1_m=y1, x2_m=x2, y2_m=y2))
    drums: list[tuple[float, float]] = []
    for _ in range(200):
        x, y = float(rng.uniform(-a + 1.3, a - 1.3)), float(rng.uniform(-b + 1.3, b - 1.3))
        if math.hypot(x, y) > 1.2 and all(math.dist((x, y), d) > 1.9 for d in drums) and len(drums) < 4:
            drums.append((x, y))
    placed = tuple(DrumConfig(x_m=x, y_m=y, radius_m=FOOT_M) for x, y in drums)
    return WorldConfig(wall=tuple(walls), drum=placed, acoustics=acoustics), (a, b)


def _legs(
    rng: np.random.Generator, world: WorldConfig, half: tuple[float, float], clear: float, step: float, turn: float,
    rows: int,
) -> Floats:  # fmt: skip
    """Return poses of a differential drive: straight and bent legs between random places, turning in place."""
    scene = compile_scene(world)
    poses: list[tuple[float, float, float]] = [(0.0, 0.0, 0.0)]
    failed = tries = 0
    while len(poses) < rows:
        failed += 1
        if failed > 200:  # hemmed in: begin again
            poses, failed, tries = [(0.0, 0.0, 0.0)], 0, tries + 1
            clear = max(0.35, clear - 0.05) if tries > 3 else clear
        x, y, theta = poses[-1]
        gx, gy = float(rng.uniform(-half[0], half[0])), float(rng.uniform(-half[1], half[1]))
        if math.dist((x, y), (gx, gy)) < 0.8:
            continue
        goal = math.atan2(gy - y, gx - x)
        by = (goal - theta + math.pi) % (2 * math.pi) - math.pi
        bend = float(rng.uniform(-0.5, 0.5)) if rng.random() < 0.5 else 0.0
        length = math.dist((x, y), (gx, gy))
        leg = []
        px, py, heading = x, y, theta + by - 0.5 * bend
        for _ in range(int(length / step)):
            heading += bend * step / length
            px, py = px + step * math.cos(heading), py + step * math.sin(heading)
            leg.append((px, py, heading))
        if not leg or any(clearance(qx, qy, scene.circles, scene.segments) < clear for qx, qy, _ in leg[::5]):
            continue
        turns = max(1, int(abs(by - 0.5 * bend) / turn))
        poses += [(x, y, theta + (by - 0.5 * bend) * (k + 1) / turns) for k in range(turns)]
        poses += leg
        failed = 0
    return np.array(poses[:rows])


@lru_cache(maxsize=8)
def make_drive(seed: int, robot: str, world_kind: str, model: str, seconds: float = DRIVE_S) -> Drive:
    """Return the drive of a seed."""
    rng = np.random.default_rng([seed, 38])
    settings = load_settings("hallway", robot=robot, models=("drum",))
    ring, body = settings.ring, settings.body
    acoustics = AcousticsConfig(
        model="cone" if model == "cone" else "specular", noise_relative=0.005, noise_m=0.003, dropout=0.03,
        outliers=0.01,
        outlier_max_m=ring.range_max_m,
    )  # fmt: skip
    period = max(ring.firing.step_period_s, 0.02)
    rows = int(seconds / period)
    speed = float(rng.uniform(0.15, 0.35))
    if world_kind == "hall":
        way = oval(rounds=3)
        true = np.array([[p.x, p.y, p.theta] for p in way])
        at = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(true[:, :2], axis=0).T))])
        want = np.minimum(speed * period * np.arange(rows), at[-1])
        true = np.column_stack([np.interp(want, at, true[:, k]) for k in range(3)])
        feet = [(x * FOOT_M, y * FOOT_M) for y in (4.2, -4.2) for x in (1.0, 4.3, 7.0)]
        moved = [(x + float(rng.uniform(-0.1, 0.1)), y + float(rng.uniform(-0.1, 0.1))) for x, y in feet]
        world = WorldConfig(
            drum=tuple(DrumConfig(x_m=x, y_m=y, radius_m=FOOT_M) for x, y in moved), acoustics=acoustics
        )
    else:
        world, half = _room(rng, acoustics)
        true = _legs(rng, world, half, min(body.radius_m + 0.12, 0.5), speed * period, 0.6 * period, rows)
    sonar = Sonar(ring, compile_scene(world), acoustics, np.random.default_rng([seed, 39]))
    masks = firing_pattern(ring).masks
    yaw = np.full(len(true), true[0, 2]) if body.synchro else true[:, 2]
    ranges = np.array([
        sonar.fire(Pose(*p), y, sensors(masks[k % len(masks)]))
        for k, (p, y) in enumerate(zip(true.tolist(), yaw, strict=True))
    ])  # fmt: skip
    start = Pose(*true[0])
    back = start.inverse()
    local = [back.compose(Pose(*p)) for p in true.tolist()]
    pose = np.array([[p.x, p.y, p.theta, w - true[0, 2]] for p, w in zip(local, yaw, strict=True)])
    return Drive(robot, world, settings, np.arange(rows, dtype=np.float64) * period, pose, ranges)


def latched(drive: Drive, row_s: float = ROW_S) -> Drive:
    """Return the drive as rows at a fixed rate with the last value of each sensor."""
    at = np.arange(drive.t[0], drive.t[-1], row_s)
    last = np.searchsorted(drive.t, at, side="right") - 1
    held = drive.ranges.copy()
    for k in range(1, len(held)):
        held[k] = np.where(np.isnan(held[k]), held[k - 1], held[k])
    return replace(drive, t=at, pose=drive.pose[last], ranges=held[last])


def written(drive: Drive, how: Convention, rng: np.random.Generator, path: Path) -> Path:
    """Write a drive as a table of this convention."""
    if how.latched:
        drive = latched(drive)
    x, y, theta, yaw = drive.pose.T.copy()
    ranges = drive.ranges.copy()
    rule = HEADINGS["ccw" if how.heading == "sensors-cw" else how.heading]
    y = rule.hand * y
    theta, yaw = (rule.turn * (rule.hand * a - rule.offset_rad) for a in (theta, yaw))
    if how.heading == "sensors-cw" or how.mirrored:
        ranges = ranges[:, mirrored_columns(drive.settings.ring)]
    if how.order:
        ranges = ranges[:, list(how.order)]
    ranges = np.roll(ranges, how.shift, axis=1)
    if how.wrapped != "no":
        low = 0.0 if how.wrapped == "positive" else -math.pi
        theta, yaw = ((a - low) % (2 * math.pi) + low for a in (theta, yaw))
    silent = np.isinf(ranges)
    top = drive.settings.ring.range_max_m
    unit = LENGTHS[how.range_]
    out = np.where(silent, np.nan, np.round(ranges * unit, how.decimals))
    n = int(silent.sum())
    fill: dict[str, object] = {
        "inf": "inf", "zero": 0, "max": round(top * unit, how.decimals), "-1": -1, "nan": "nan",
        "999": 999, "65535": 65535, "255": 255,
    }  # fmt: skip
    text = [[(how.not_fired if v != v else repr(v)) for v in row] for row in out.tolist()]
    noisy = np.round((top - 0.15 + 0.05 * rng.standard_normal(n)) * unit, how.decimals).tolist()
    for count, (i, j) in enumerate(zip(*np.nonzero(silent), strict=True)):
        if how.silence == "noisy-max":
            text[i][j] = repr(noisy[count])
        elif how.silence == "glitch-max":
            text[i][j] = str(fill["max"]) if count != n // 2 else repr(round(4.4 * top * unit, how.decimals))
        else:
            text[i][j] = str(fill[how.silence])
    header = ["t", "x", "y", "theta", "ring_yaw", *(f"r{k:02d}" for k in range(ranges.shape[1]))]
    scale = LENGTHS[how.position]
    lead = np.column_stack(
        [drive.t * TIMES[how.time], x * scale, y * scale, theta * ANGLES[how.angle], yaw * ANGLES[how.angle]]
    )
    lead = np.round(lead, 5).tolist()
    lines = [",".join([*map(repr, a), *b]) for a, b in zip(lead, text, strict=True)]
    path.write_text("\n".join([",".join(header), *lines, ""]), "utf-8")
    return path


@dataclass(frozen=True)
class Case:
    """A table of the adversary's."""

    seed: int
    robot: str
    world: str
    model: str
    how: Convention = field(default_factory=Convention)


def draw(seed: int) -> Case:
    """Return the table of a seed, drawn over robots, worlds, acoustics and conventions."""
    rng = np.random.default_rng([seed, 200])

    def pick(values: tuple[str, ...]) -> str:
        return str(rng.choice(np.array(values)))

    unit = pick(tuple(LENGTHS))
    apart = rng.random() < 0.4
    how = Convention(
        heading=pick(HEADING_NAMES), angle=pick(tuple(ANGLES)), wrapped=pick(("no", "signed", "positive")),  # type: ignore[arg-type]
        position=pick(("m", "cm", "mm")) if apart else unit, range_=unit, time=pick(tuple(TIMES)),
        silence=pick(SILENCES), latched=bool(rng.random() < 0.4),
    )  # fmt: skip
    case = Case(seed, pick(ROBOTS), pick(WORLDS), pick(MODELS), how)
    if rng.random() < 0.25:
        how = replace(how, heading=pick(RARE_HEADINGS))
    if not how.latched and rng.random() < 0.25:
        how = replace(how, not_fired=pick(NOT_FIRED), silence=pick(("max", "noisy-max", "999")))
    return replace(case, how=how)
