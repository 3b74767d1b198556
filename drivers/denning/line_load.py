"""What a Denning sends regularly: its odometry and the echoes of its firing pattern."""

from __future__ import annotations

from typing import Final

from config.robot import LinkConfig
from drivers.denning.codec import encode
from drivers.denning.frames import Echo, Echo2, Echo3, Odom, Sweep
from drivers.denning.wire_units import WirePattern
from drivers.line_budget import refuse_slow_line

ODOMETRY_PERIOD_S: Final = 0.02
"""Usual time between two samples of odometry, s; what a robot really has, it says only once the line is open."""


def odometry_bytes_s() -> float:
    """Return what its odometry takes, byte/s."""
    return len(encode(Odom(1, 0x55AA55AA, 0x11AA, 0x11AA, 0x11AA, 0x11AA, 0x11, 0x11, 1, 1))) / ODOMETRY_PERIOD_S


def sent_bytes_s(
    pattern: WirePattern, listeners: tuple[int, ...], version: int, sweeps: tuple[Sweep, ...] = ()
) -> float:
    """Return how much a robot sends regularly, byte/s.

    `listeners` are the masks of each step, empty where none listens.
    """
    return odometry_bytes_s() + _firing_bytes(pattern, listeners, version, sweeps) / (1e-3 * pattern.step_period_ms)


def _firing_bytes(pattern: WirePattern, listeners: tuple[int, ...], version: int, sweeps: tuple[Sweep, ...]) -> float:
    """Return the mean size of a firing's echoes, bytes."""
    echoes = 0
    for step, mask in enumerate(pattern.masks):
        heard = listeners[step] if listeners else 0
        fired, all_counts = mask.bit_count(), mask.bit_count() + heard.bit_count()
        frame = Echo(1, 0x55AA55AA, step, mask, (9,) * fired)
        turned = mask & sum(1 << sweep.sensor for sweep in sweeps)
        angles = (0x1101,) * turned.bit_count()
        finer = (
            Echo3(1, 0x55AA55AA, step, mask, turned, (0x1101,) * fired, angles)
            if sweeps
            else Echo2(1, 0x55AA55AA, step, mask, heard, (0x1101,) * all_counts)
        )
        echoes += len(encode(finer if version > 1 else frame))
    return echoes / len(pattern.masks)


def refuse_overload(
    link: LinkConfig, pattern: WirePattern, listeners: tuple[int, ...], version: int, sweeps: tuple[Sweep, ...] = ()
) -> None:
    """Raise an error if the line is too slow for the traffic.

    Arguments are as of `sent_bytes_s`.

    Raises
    ------
    FiringError
        It is too slow.
    """
    step_s = 1e-3 * pattern.step_period_ms
    refuse_slow_line(link, odometry_bytes_s(), _firing_bytes(pattern, listeners, version, sweeps), step_s)
