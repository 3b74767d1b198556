"""Drumheller's sonar barrier test: sound passes through no wall."""

from __future__ import annotations

from typing import Final

import numpy as np

from perception.kernel import Floats
from perception.localization.room.expected_ranges import Beams, crossed
from perception.localization.room.room import Room
from perception.shared_numbers import PASSED_M

BEAM_RAYS: Final = 5
"""Rays across a beam. The echo may come from anywhere in the beam, so that one free ray is enough."""


def blocked_share(room: Room, beams: Beams, measured: Floats, half_angle: float) -> Floats:
    """Return the share of the heard ranges at each pose that no ray of their beam reaches without crossing a wall.

    The paper asks that no ray crosses a wall before the measured range; here an echo that comes too late, as mirrors
    and outliers give it, counts against a pose, and the caller allows a share of them.

    Parameters
    ----------
    room : Room
        The walls.
    beams : Beams
        The sensors in the map frame, shape (poses, n).
    measured : (n,) float
        Ranges, m. Silence is not tested.
    half_angle : float
        Half the beam's opening, rad.
    """
    heard = np.flatnonzero(np.isfinite(measured))
    if not len(heard):
        return np.zeros(len(beams.x))
    x, y, axis = beams.x[:, heard], beams.y[:, heard], beams.axis[:, heard]
    blocked = np.ones(x.shape, dtype=np.bool_)
    for off in np.linspace(-half_angle, half_angle, BEAM_RAYS):
        to_x, to_y = x + measured[heard] * np.cos(axis + off), y + measured[heard] * np.sin(axis + off)
        hit = crossed(room, x.reshape(-1), y.reshape(-1), to_x.reshape(-1), to_y.reshape(-1), PASSED_M)
        blocked &= hit.reshape(x.shape)
    return np.asarray(blocked.mean(axis=1))
