"""A list that frames show whole when it has changed, such as the objects left behind: each row is encoded once."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

import orjson

T = TypeVar("T", bound=Hashable)


class ChangingRows(Generic[T]):
    """The list as the last frame had it.

    `row` returns what JSON has of an item; equal items have equal rows.

    Attributes
    ----------
    json : bytes
        The whole list.
    """

    def __init__(self, row: Callable[[T], object]) -> None:
        self._row = row
        self._items: tuple[T, ...] = ()
        self._rows: dict[T, bytes] = {}
        self.json = b"[]"

    def update(self, items: tuple[T, ...]) -> bool:
        """Take the items as they are now and return whether any differs; the same tuple costs nothing."""
        if items is self._items:
            return False
        before, self._items = self._rows, items
        self._rows = {item: before.get(item) or orjson.dumps(self._row(item)) for item in items}
        self.json = b"[%b]" % b",".join(self._rows.values())
        return self._rows.keys() != before.keys()
