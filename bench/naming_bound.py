"""How early any rule can call a drum a drum and not a post: the bound that the ranges of a drive set.

The rule of greatest power names a body once the likelihood ratio of drum to rival exceeds a threshold (Neyman and
Pearson). For ranges with normal noise its logarithm is normal with mean ± d² / 2 and variance d², with d as in
`bench.stand_bound`: from every range heard over the drum up to 4 ft ahead, the rival at its best place. A sensor
hears what is nearest in its beam, so that nearer drums keep a farther one from being heard. Association is perfect
here, and the noise known; strays and drop-outs are readings that are missing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from statistics import NormalDist
from typing import Final, NamedTuple

import numpy as np

from bench.ear_halls import firings, rings
from bench.stand_bound import SIGMA_M, apart
from config.robot import RingConfig
from config.units import FOOT_M
from config.world import DrumConfig
from perception.echo_kind import half_paths_over_circle
from runtime.simulation.first_fix import EARLY_FIX_M
from runtime.simulation.scene_names import SceneName
from runtime.simulation.scenes import Hall, halls

RIVALS: Final = {"edge": 0.0, "post": 0.35 * FOOT_M, "barrel": 2.2 * FOOT_M}
"""Radii, m: those of the random halls, and an edge."""
NAMED: Final = 0.95
"""Share of the drums that are to be named in time."""
_NATS: Final = 60.0
_HALVINGS: Final = 60


class Heard(NamedTuple):
    """Paths of a drive: where the ring's centre was along the hall, transmitter and listener, half the way; m."""

    x: np.ndarray
    sending: np.ndarray
    """Places as complex numbers."""
    receiving: np.ndarray
    half: np.ndarray


def drive(ring: RingConfig, hall: Hall) -> Heard:
    """Return all paths that a ring hears on its way through a hall, firing by its pattern, without noise."""
    sound = hall.world.acoustics.model_copy(update={"noise_m": 0.0, "dropout": 0.0, "outliers": 0.0})
    quiet = replace(hall, world=hall.world.model_copy(update={"acoustics": sound}))
    mounts = np.array([complex(mount.x_m, mount.y_m) for mount in ring.mounts])
    parts = []
    for firing in firings(ring, quiet, 0):
        own, paths = np.arange(len(mounts)), firing.cross_paths
        sender, listener, half = own, own, firing.ranges_m
        if paths is not None:
            sender, listener = np.append(own, paths.transmitters), np.append(own, paths.listeners)
            half = np.append(half, paths.half_paths_m)
        at = complex(firing.pose.x, firing.pose.y) + mounts * np.exp(1j * firing.ring_yaw)
        is_heard = np.isfinite(half)
        x = np.full(is_heard.sum(), firing.pose.x)
        parts.append((x, at[sender[is_heard]], at[listener[is_heard]], half[is_heard]))
    return Heard(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def heard_of(all_paths: Heard, drum: DrumConfig, step_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Return places of transmitter and listener, complex, m, of the paths over a drum up to 4 ft ahead of it.

    Parameters
    ----------
    all_paths, drum
        What was heard, and the drum.
    step_m
        The ranges' resolution, m.
    """
    _, sending, receiving, half = (column[all_paths.x <= drum.x_m - EARLY_FIX_M] for column in all_paths)
    over = half_paths_over_circle(sending, receiving, complex(drum.x_m, drum.y_m), drum.radius_m)
    is_of_drum = abs(half - over) <= step_m
    return sending[is_of_drum], receiving[is_of_drum]


def named_too(apart_by: Sequence[float]) -> float:
    """Return the share of rivals that the best rule names, with the threshold at which it names enough drums.

    Parameters
    ----------
    apart_by
        d of each drum's place.
    """
    d, normal = np.array(apart_by), NormalDist()

    def share(threshold: float, mean: float) -> float:
        return float(np.mean([normal.cdf((mean * v * v - threshold) / v) for v in d]))

    low, high = -_NATS, _NATS
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if share(middle, 0.5) >= NAMED else (low, middle)
    return share(low, -0.5)


def bounds(name: SceneName, seed: int) -> dict[str, float]:
    """Return what the ring with listeners hears of a drum up to 4 ft ahead of it, and what that says of each rival.

    Of a rival: by how many nats a drum is expected to lead, from the least to the greatest of the hall's drums, and
    the share of such rivals, %, that a rule names which names 95 % of the drums.

    Parameters
    ----------
    name, seed
        A scene without a path, and with noise.
    """
    ring, hall = rings()["ears"], halls(name, seed)[0]
    sound = hall.world.acoustics
    kept = (1.0 - sound.dropout) * (1.0 - sound.outliers) * SIGMA_M**2 / (SIGMA_M**2 + sound.noise_m**2)
    paths = drive(ring, hall)
    ways = [heard_of(paths, drum, ring.resolution_m) for drum in hall.world.drum]
    row = {"paths of a drum": float(np.mean([len(sending) for sending, _ in ways]))}
    for rival, radius in RIVALS.items():
        d = []
        for drum, (sending, receiving) in zip(hall.world.drum, ways, strict=True):
            origin = complex(sending.mean())
            to = complex(drum.x_m, drum.y_m) - origin
            bearing, away = math.atan2(to.imag, to.real), abs(to) - drum.radius_m
            d.append(
                math.sqrt(kept) * apart(sending - origin, receiving - origin, bearing, away, drum.radius_m, radius)
            )
        row |= {f"{rival}, nats from": 0.5 * min(d) ** 2, f"{rival}, to": 0.5 * max(d) ** 2}
        row[f"{rival} named, %"] = 100.0 * named_too(d)
    return row
