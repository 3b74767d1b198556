"""Firing patterns that no setting forbids and that the ring or the wire cannot carry out, refused before a run."""

from __future__ import annotations

from config.robot import RingConfig
from drivers.denning.wire_units import wire_pattern
from drivers.firing_pattern import FiringError
from runtime.support.errors import WRONG_CALL, UserError


def refuse_impossible_firing(ring: RingConfig) -> None:
    """Do nothing where the ring can fire as it is set to.

    Raises
    ------
    UserError
        It cannot; the text says why, and what would do.
    """
    try:
        wire_pattern(ring)
    except FiringError as error:
        raise UserError(str(error), WRONG_CALL) from error
