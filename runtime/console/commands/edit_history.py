"""The edits of the map that can be undone, the newest ones."""

from __future__ import annotations

from collections import deque
from typing import Final

from perception.edits import Edit
from perception.undo import Undo

KEPT: Final = 50
"""Edits that can be undone, the newest ones."""


class EditHistory:
    """The edits that can be undone."""

    def __init__(self) -> None:
        self._undos: deque[tuple[Edit, Undo]] = deque(maxlen=KEPT)

    def add(self, edit: Edit, undo: Undo) -> None:
        """Take in an edit that was carried out, if only in part; nothing where it changed nothing."""
        if undo:
            self._undos.append((edit, undo))

    @property
    def newest(self) -> tuple[Edit, Undo] | None:
        """The newest edit and what takes it back; None if there is none."""
        return self._undos[-1] if self._undos else None

    def drop_newest(self) -> None:
        """Forget the newest edit, which is being taken back."""
        self._undos.pop()

    def clear(self) -> None:
        """Forget all, as after a reset of the odometry: places mean something else then."""
        self._undos.clear()
