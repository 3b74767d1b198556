"""Consistency of the correction of drift: squared errors over the covariance that the filter reports, in many drives.

The mean of a consistent filter's normalised squared errors (NEES) over n drives is χ² of n times its degrees of
freedom, over n (Y. Bar-Shalom, X. R. Li and T. Kirubarajan, "Estimation with Applications to Tracking and
Navigation", 2001, 5.4). The drums of one drive share the errors of the map, so that a drive counts once for the band
of the drums.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Final

from bench.correction_drives import level_name
from config.settings import Settings
from runtime.simulation.drift_trials import LEVELS, drive, summarise_drives

POSE_DEGREES: Final = 3
PLACE_DEGREES: Final = 2
"""Degrees of freedom of a pose and of the place of a drum."""
SIGMAS: Final = 1.96
"""Of a normal variable, within which 95 % lie."""


def band(degrees: int, drives: int) -> tuple[float, float]:
    """Return the band in which 95 % of the means of so many consistent drives lie.

    χ² by E. B. Wilson and M. M. Hilferty, "The distribution of chi-square" (1931).
    """
    total = degrees * drives
    spread = 2.0 / (9.0 * total)
    low, high = (degrees * (1.0 - spread + sign * SIGMAS * math.sqrt(spread)) ** 3 for sign in (-1.0, 1.0))
    return low, high


def measure(
    settings: Settings, seeds: Iterable[int], report: Callable[[str], None]
) -> dict[str, dict[str, float]]:  # fmt: skip
    """Return the figures of the drives with correction, by level of odometry's errors.

    Parameters
    ----------
    settings
        Ring, models and perception.
    seeds
        Which drives.
    report
        Called with a line on what is running.
    """
    seeds, rows = tuple(seeds), {}
    pose, place = band(POSE_DEGREES, len(seeds)), band(PLACE_DEGREES, len(seeds))
    for errors in LEVELS[1:]:
        name = level_name(errors)
        outcomes = []
        for seed in seeds:
            report(f"nees: {name}, drive {seed}")
            outcomes.append(drive(settings, errors, seed, corrected=True))
        row = summarise_drives(errors, outcomes)
        rows[name] = {
            "drives": float(len(seeds)),
            "pose": row["nees"] or math.nan, "pose_low": pose[0], "pose_high": pose[1],
            "drums": row["object_nees"] or math.nan, "drums_low": place[0], "drums_high": place[1],
            "heading_deg": row["heading_deg"], "place_m": row["place"], "drum_m": row["mean_error"] or math.nan,
            "missed": float(row["missed"]), "false": float(row["false"]),
            "odometer_rms": row["odometer_error"] or math.nan, "range_rms": row["range_error"] or math.nan,
        }  # fmt: skip
    return rows
