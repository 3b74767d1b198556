"""Statistics of the ranges of real drives and of generated rooms: silence, late echoes, jumps, repeats, distances.

The real ones are of drives whose rings were cut from a laser's scans. Their statistics stand here as numbers, so that
the rooms are held to them where the drives are not at hand.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterable
from pathlib import Path
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from bench.trials.imperfect_rooms import drive_through, imperfect_room
from config.errors import WRONG_CALL, UserError
from config.robot import FiringConfig, RingConfig, SensorConfig
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.messages import Floats, Pose, wrap_angle

AXES_DEG: Final = tuple(range(-105, 106, 15))
RING: Final = RingConfig(
    sensors=tuple(SensorConfig(x_m=0.0, y_m=0.0, angle_deg=float(axis)) for axis in AXES_DEG),
    beam_half_angle_deg=12.0, resolution_m=0.03048, range_min_m=0.1524, range_max_m=5.0,
    firing=FiringConfig(sets=(tuple(range(len(AXES_DEG))),)),
)  # fmt: skip
"""The ring of the real drives."""
POSE_COLUMNS: Final = 4
"""Columns of a ring log before the ranges: time and pose."""
STEP_M: Final = 0.08
TURN_RAD: Final = math.radians(6.0)
"""Way and most turn between two firings, of real drives .06 and .1 m at the median, 6° and 8° at the 90 % point."""
LENGTH_M: Final = 40.0
JUMP_M: Final = 0.3
SAME_M: Final = 1e-3
QUANTILES: Final = (0.05, 0.25, 0.5, 0.75, 0.95)

REAL: Final = MappingProxyType(
    {
        "cone": ("mines-2-cone", "freiburg-079a-cone"),
        "mirrors": ("mines-2-mirrors", "freiburg-079a-mirrors"),
    }
)
"""The real drives that a model of the acoustics is compared with: mines-2 is from the logs of BreezySLAM (Levy,
LGPL), freiburg-079a from Radish by way of acschaefer/ple."""


KNOWN: Final = MappingProxyType(
    {
        "mines-2-cone": (0.191, 0.0, 0.124, 0.255, 0.055, 0.549, 0.914, 1.341, 2.164, 3.749),
        "freiburg-079a-cone": (0.018, 0.0, 0.096, 0.211, 0.007, 0.518, 1.067, 1.463, 2.012, 3.536),
        "mines-2-mirrors": (0.385, 0.078, 0.197, 0.226, 0.194, 0.518, 0.853, 1.433, 2.682, 4.420),
        "freiburg-079a-mirrors": (0.280, 0.046, 0.207, 0.168, 0.215, 0.488, 0.975, 1.554, 2.743, 4.298),
    }
)
"""The statistics of the real drives, in the order in which `statistics` has them."""
COLUMNS: Final = ("silent", "late", "jumps", "repeated", "turned", *(f"{q:.0%} m" for q in QUANTILES))
"""Share of silent beams; of late echoes among the heard; of jumps and of repeated ranges among pairs of successive
echoes of a sensor; of beams that fall silent or answer again from one firing to the next; quantiles of the ranges."""


def statistics(ranges_m: Floats, is_late: NDArray[np.bool_]) -> dict[str, float]:
    """Return the statistics of a drive.

    Parameters
    ----------
    ranges_m : (firings, sensors) float
        m; inf for silence. All sensors fire at once.
    is_late : (firings, sensors) bool
        Which ranges are not of a surface in the beam.
    """
    heard = np.isfinite(ranges_m)
    both = heard[1:] & heard[:-1]
    change = np.abs(np.where(both, ranges_m[1:], 0.0) - np.where(both, ranges_m[:-1], 0.0))[both]
    turned = heard[1:] != heard[:-1]
    found = {
        "silent": float(1.0 - heard.mean()),
        "late": float(is_late[heard].mean()),
        "jumps": float((change > JUMP_M).mean()),
        "repeated": float((change < SAME_M).mean()),
        "turned": float(turned.mean()),
    }
    return found | {f"{q:.0%} m": float(np.quantile(ranges_m[heard], q)) for q in QUANTILES}


def real_drive(folder: Path) -> dict[str, float]:
    """Return the statistics of a real drive.

    Parameters
    ----------
    folder : Path
        Holds ring.csv, a ring log, and bearings.csv, where an echo came from; empty for what no surface answered.

    Raises
    ------
    UserError
        They cannot be read.
    """
    ring, bearings = read_tables(folder, "ring.csv", "bearings.csv")
    ranges_m = ring[:, POSE_COLUMNS:]
    return statistics(ranges_m, np.isfinite(ranges_m) & np.isnan(bearings))


def read_tables(folder: Path, *names: str) -> list[Floats]:
    """Return the numbers of tables of a real drive, a row a firing; an empty cell is NaN.

    Parameters
    ----------
    folder : Path
        The drive's.
    *names : str
        The tables' files.

    Raises
    ------
    UserError
        They cannot be read.
    """
    try:
        return [_read_table(folder / name) for name in names]
    except (OSError, ValueError) as error:
        raise UserError(f"{folder}: no drive with {' and '.join(names)}: {error}", WRONG_CALL) from error


def _read_table(path: Path) -> Floats:
    with path.open(encoding="ascii", newline="") as file:
        _, *rows = csv.reader(file)
    return np.array([[float(cell or "nan") for cell in row] for row in rows])


def facing_ahead(poses: Floats, turn_rad: float) -> Floats:
    """Return the poses of a base that faces where it goes, and turns on the spot where that changes, shape (n, 3).

    Parameters
    ----------
    poses : (n, 3) float
        Where it goes, m; the last column is not used.
    turn_rad : float
        Most turn between two poses.
    """
    steps = np.diff(poses[:, :2], axis=0)
    ahead = np.arctan2(steps[:, 1], steps[:, 0])
    rows: list[tuple[float, float, float]] = []
    facing = float(ahead[0])
    for (x, y), wanted in zip(poses[:-1, :2].tolist(), ahead.tolist(), strict=True):
        left = math.inf
        while abs(left) > turn_rad:
            left = wrap_angle(wanted - facing)
            facing += min(turn_rad, max(-turn_rad, left))
            rows.append((x, y, facing))
    return np.array(rows)


def room_drive(seed: int, model: str) -> dict[str, float]:
    """Return the statistics of a drive through a generated room with the ring of the real ones.

    Parameters
    ----------
    seed : int
        Which room; every other one has drums.
    model : str
        A name of `imperfect_rooms.MODELS`.
    """
    room = imperfect_room(seed, model, 3 * (seed % 2))
    sonar = Sonar(RING, compile_scene(room.world), room.world.acoustics, np.random.default_rng([seed, 43]))
    ranges, late = [], []
    for x, y, yaw in facing_ahead(drive_through(room, seed, STEP_M, LENGTH_M), TURN_RAD).tolist():
        ranges.append(sonar.fire(Pose(x, y, yaw), yaw))
        late.append(np.isfinite(ranges[-1]) & np.isinf(sonar.echoes["distance"]))
    return statistics(np.array(ranges), np.array(late))


def measure(
    seeds: Iterable[int], models: Iterable[str], real: Path | None, report: Callable[[str], None]
) -> dict[str, dict[str, float]]:
    """Return the statistics of the real drives, and means over generated rooms.

    Parameters
    ----------
    seeds
        Which rooms.
    models
        Names of `imperfect_rooms.MODELS`.
    real
        Folder of the real drives; without it what is known of them.
    report
        Called with a line on what is running.
    """
    seeds = tuple(seeds)
    rows = {}
    for name, known in KNOWN.items():
        rows[name] = real_drive(real / name) if real else dict(zip(COLUMNS, known, strict=True))
    for model in models:
        found = []
        for seed in seeds:
            report(f"range statistics: {model}, room {seed}")
            found.append(room_drive(seed, model))
        rows[f"rooms, {model}"] = {key: float(np.mean([it[key] for it in found])) for key in found[0]}
        rows[f"rooms, {model}, spread"] = {key: float(np.std([it[key] for it in found])) for key in found[0]}
    return rows
