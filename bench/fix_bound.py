"""Lower bound of the distance at which a drum can be located, for comparison with the first confident fixes.

Association is perfect, radius and noise are known, and the centre is the posterior mean over a grid around the truth
(at most a foot off), beams included. No method can locate a drum earlier from the same ranges; a later fix is the
price of recognising that the object is a drum.
"""

from __future__ import annotations

import argparse
import math
import sys
from typing import Final

import numpy as np

from config.load import load_settings
from runtime.simulation.scenes import Hall, halls, readings

FT: Final = 0.3048
ERROR_MAX_FT: Final = 0.25
"""Error below which a drum counts as located."""
DISTANCE_FT: Final = 4.0
"""Distance ahead of the drum at which it has to be located."""
SIGMA_FT: Final = {"clean": 0.001, "walls": 0.001, "moved": 0.001, "noisy": 0.05, "jit10": 0.03}
"""Standard deviation of each scene's noise."""
HALF_STEP_FT: Final = 0.05
"""Half of the quantisation step of a range."""
ERF_AT: Final = np.linspace(-6.0, 6.0, 4801)
ERF: Final = np.array([math.erf(v) for v in ERF_AT])


def own_readings(hall: Hall, seed: int, sigma: float) -> list[list[tuple[float, ...]]]:
    """Return for each drum its own readings up to `DISTANCE_FT` ahead: sensor x, y, range (ft), and the beam's axis.

    Parameters
    ----------
    hall
        Hall to drive through.
    seed
        Seed of the noise.
    sigma
        Standard deviation of the noise, ft.
    """
    ring = load_settings("hallway", ["perception.method=bayes"]).ring
    rows: list[list[tuple[float, ...]]] = [[] for _ in hall.world.drum]
    for firing in readings(ring, hall, seed):
        for mount, range_m in zip(ring.mounts, firing.ranges_m, strict=True):
            x, y, r = (firing.pose.x + mount.x_m) / FT, mount.y_m / FT, float(range_m) / FT
            ux, uy = math.cos(mount.angle_rad), math.sin(mount.angle_rad)
            for row, drum in zip(rows, hall.world.drum, strict=True):
                dx, dy = drum.x_m / FT - x, drum.y_m / FT - y
                d = math.hypot(dx, dy)
                near = abs(r - (d - drum.radius_m / FT)) < HALF_STEP_FT + 0.01 + 4.0 * sigma
                in_time = drum.x_m - firing.pose.x >= (DISTANCE_FT - 1e-9) * FT
                if in_time and near and dx * ux + dy * uy >= math.cos(math.radians(12.0)) * d:
                    row.append((x, y, r, ux, uy))
    return rows


def error(rows: list[tuple[float, ...]], cx: float, cy: float, radius: float, sigma: float) -> float:
    """Return the distance of the posterior mean from the truth, ft; evaluated on a coarse and then a fine grid.

    Parameters
    ----------
    rows
        The drum's own readings, see `own_readings`.
    cx, cy
        True centre, ft.
    radius
        True radius, ft.
    sigma
        Standard deviation of the noise, ft.
    """
    ox, oy, half = cx, cy, 1.0
    for _ in range(2):
        g = np.linspace(-half, half, 81)
        px, py = np.meshgrid(ox + g, oy + g)
        total = np.zeros_like(px)
        for x, y, r, ux, uy in rows:
            dx, dy = px - x, py - y
            d = np.hypot(dx, dy)
            e = (r - (d - radius)) / (sigma * math.sqrt(2.0))
            h = HALF_STEP_FT / (sigma * math.sqrt(2.0))
            box = 0.5 * (np.interp(e + h, ERF_AT, ERF) - np.interp(e - h, ERF_AT, ERF))
            outside = dx * ux + dy * uy < math.cos(math.radians(12.0)) * d
            total += np.log(np.maximum(box, 1e-6)) - 1e3 * outside
        weight = np.exp(total - total.max())
        weight /= weight.sum()
        ox, oy = float((weight * px).sum()), float((weight * py).sum())
        spread = math.sqrt(float((weight * ((px - ox) ** 2 + (py - oy) ** 2)).sum()))
        half = min(1.0, max(0.05, 5.0 * spread))
    return math.hypot(ox - cx, oy - cy)


def main() -> None:
    """Print the share of drums that could be located to `ERROR_MAX_FT` at `DISTANCE_FT`."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene", choices=sorted(SIGMA_FT))
    parser.add_argument("--seeds", type=int, default=1)
    call = parser.parse_args()
    sigma, errors = SIGMA_FT[call.scene], []
    for seed in range(call.seeds):
        for i, hall in enumerate(halls(call.scene, seed)):
            for drum, rows in zip(hall.world.drum, own_readings(hall, seed * 1000 + i, sigma), strict=True):
                place = drum.x_m / FT, drum.y_m / FT
                errors.append(error(rows, *place, drum.radius_m / FT, sigma) if len(rows) > 1 else math.inf)
    share = np.mean(np.array(errors) <= ERROR_MAX_FT)
    sys.stdout.write(
        f"{call.scene}: {share:.0%} of {len(errors)} within {ERROR_MAX_FT} ft, median {np.median(errors):.3f} ft\n"
    )


if __name__ == "__main__":
    main()
