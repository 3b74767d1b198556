"""How early any rule can call a drum a drum and not a post: the bound that the ranges of a drive set.

The rule of greatest power names a body once the likelihood ratio of drum to rival exceeds a threshold (Neyman and
Pearson). For ranges with normal noise its logarithm is normal with mean ± d² / 2 and variance d², with d as in
`bench.stand_bound`: from every range heard up to 4 ft ahead of the drum, the rival at its best place. Association is
perfect there, and the noise known; strays and drop-outs are readings that are missing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import NormalDist
from typing import Final

import numpy as np

from bench.ear_halls import poses, rings
from bench.stand_bound import SIGMA_M, apart, audible_pairs
from config.robot import RingConfig
from config.units import FOOT_M
from config.world import DrumConfig
from drivers.firing_pattern import cross_pairs, firing_pattern, sensors
from runtime.simulation.first_fix import EARLY_FIX_M
from runtime.simulation.scene_names import SceneName
from runtime.simulation.scenes import Hall, halls

RIVALS: Final = {"edge": 0.0, "post": 0.35 * FOOT_M, "barrel": 2.2 * FOOT_M}
"""Radii, m: those of the random halls, and an edge."""
NAMED: Final = 0.95
"""Share of the drums that are to be named in time."""
_NATS: Final = 60.0
_HALVINGS: Final = 60


def heard(ring: RingConfig, hall: Hall, drum: DrumConfig) -> tuple[np.ndarray, np.ndarray]:
    """Return places of transmitter and listener, complex, m, of all paths over a drum up to 4 ft ahead of it.

    Parameters
    ----------
    ring, hall, drum
        The ring, firing by its pattern on its way through the hall, and the drum, which nothing hides.
    """
    pattern, axes = firing_pattern(ring), tuple(mount.angle_rad for mount in ring.mounts)
    listening = pattern.listeners or (0,) * len(pattern.masks)
    transmitters, listeners_at = [], []
    for k, (_, pose, yaw) in enumerate(poses(hall, pattern.step_period_s)):
        if pose.x > drum.x_m - EARLY_FIX_M:
            break
        fired, listeners = pattern.masks[k % len(pattern.masks)], listening[k % len(pattern.masks)]
        pairs = [(i, i) for i in sensors(fired)] + list(cross_pairs(axes, fired, listeners))
        place, turn = complex(pose.x, pose.y), np.exp(1j * yaw)
        sending, receiving = audible_pairs(ring, pairs, (complex(drum.x_m, drum.y_m) - place) / turn)
        transmitters.append(place + turn * sending)
        listeners_at.append(place + turn * receiving)
    return np.concatenate(transmitters), np.concatenate(listeners_at)


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
    ways = [heard(ring, hall, drum) for drum in hall.world.drum]
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
