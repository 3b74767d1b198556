"""The operator's drive requests that wait for a cycle, each of which carries out one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from behaviors.missions.mission import MissionEdit
from runtime.cycle.drive_requests import DriveInput

WAITING_MAX: Final = 8
"""Most requests that wait: more than a person makes in a cycle."""


class DriveInputs:
    """The requests that wait: at most one that replaces what is driven, and the changes of a mission after it."""

    def __init__(self) -> None:
        self._waiting: list[tuple[DriveInput, Callable[[], bool]]] = []

    def put(self, asked: DriveInput, is_valid: Callable[[], bool]) -> bool:
        """Add a request; return False, and add none, where too many wait. One that replaces the drive replaces them.

        Parameters
        ----------
        asked : DriveInput
            The request.
        is_valid : callable
            Returns False once the request must not be carried out any more.
        """
        if not isinstance(asked, MissionEdit):
            self._waiting.clear()
        if len(self._waiting) == WAITING_MAX:
            return False
        self._waiting.append((asked, is_valid))
        return True

    def take(self) -> DriveInput | None:
        """Return the request that the next cycle carries out, None if there is none; drop those no longer valid."""
        while self._waiting:
            asked, is_valid = self._waiting.pop(0)
            if is_valid():
                return asked
        return None
