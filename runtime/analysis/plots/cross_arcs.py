"""The arcs of cross paths: where on the ellipse about both sensors a surface may lie, as the page draws them."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from drivers.firing_pattern import LISTENING_LOBE
from drivers.messages import Floats
from runtime.analysis.timeline import CrossPathRows

POINTS: Final = 9
NEWEST_S: Final = 1.0

Complex = NDArray[np.complex128]


def newest_cross_paths(rows: CrossPathRows, t_s: float) -> CrossPathRows:
    """Return the rows of the last second before a time."""
    first, last = np.searchsorted(rows["t_s"], [t_s - NEWEST_S, t_s], side="right")
    newest: CrossPathRows = rows[first:last]
    return newest


def heard_cross_paths(rows: CrossPathRows) -> CrossPathRows:
    """Return the rows that were heard, and are longer than their sensors are apart."""
    apart = np.hypot(rows["x"] - rows["listener_x"], rows["y"] - rows["listener_y"])
    heard: CrossPathRows = rows[np.isfinite(rows["half_path_m"]) & (2.0 * rows["half_path_m"] > apart)]
    return heard


def cross_arcs(rows: CrossPathRows, half_angle: float) -> Floats:
    """Return points along the arc of each cross path, shape (n, 9, 2), m.

    The arc is the part of the ellipse within both beams. A listener hears beyond its own: where the beams do not meet
    on the ellipse, it is the part within the transmitter's beam and twice the listener's, and at last all of the
    transmitter's.

    Rows are of `heard_cross_paths`; half the beam's opening is in rad.
    """
    t, listener = rows["x"] + 1j * rows["y"], rows["listener_x"] + 1j * rows["listener_y"]
    bearing, half = rows["bearing"], rows["half_path_m"]
    focus, across = 0.5 * abs(listener - t), np.angle(listener - t)

    def point(at: Complex, direction: Floats, other: Floats) -> Complex:
        """Return the ellipse's point in a direction from a focus; `other` is the direction of the other focus."""
        reach = (half**2 - focus**2) / (half - focus * np.cos(direction - other))
        return np.asarray(at + reach * np.exp(1j * direction))

    low, high = np.full(len(rows), -half_angle), np.full(len(rows), half_angle)
    for width in (LISTENING_LOBE * half_angle, half_angle):
        edges = (point(listener, rows["listener_bearing"] + off, across + np.pi) for off in (-width, width))
        first, last = (np.angle((edge - t) * np.exp(-1j * bearing)) for edge in edges)
        first, last = np.maximum(first, -half_angle), np.minimum(last, half_angle)
        meet = first < last
        low, high = np.where(meet, first, low), np.where(meet, last, high)
    steps = np.linspace(0.0, 1.0, POINTS)[:, None]
    along = point(t, bearing + low + (high - low) * steps, across).T
    points: Floats = np.stack([along.real, along.imag], axis=-1)
    return points
