"""Settings merged from several sources, with the source of each value.

A run's settings come from several files and the command line. An error must name the file that holds the offending
value, so the merged tree keeps the source of every value.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

from config.errors import WRONG_CALL, UserError

Location: TypeAlias = tuple[str | int, ...]
"""Path from the root to a value: keys of tables, indices of list entries."""

Holder: TypeAlias = dict[str, Any] | list[Any]
"""A table or a list."""

FIRING: Location = ("ring", "firing")
"""The table that is replaced as a whole when another firing pattern is named."""


@dataclass(frozen=True)
class Source:
    """A source of settings, and the location of its root in the tree of all settings."""

    name: str
    base: Path = Path()
    """Folder from which relative paths in this source start."""
    mount: Location = ()

    def mounted(self, mount: Location) -> Source:
        """Return the same source with its root at `mount`."""
        return replace(self, mount=mount)

    def local(self, location: Location) -> Location:
        """Return `location` as it is written in this source."""
        inside = location[: len(self.mount)] == self.mount
        return location[len(self.mount) :] if inside else location


class PathError(UserError):
    """A dotted path does not name a setting; the text says why."""

    exit_code = WRONG_CALL


class Layers:
    """A tree of settings to which sources are added; later ones take precedence."""

    def __init__(self, root: Source) -> None:
        self.tree: dict[str, Any] = {}
        self._origins: dict[Location, Source] = {(): root}
        self._order: list[str] = [root.name]

    def lay(self, table: dict[str, Any], source: Source, at: Location = ()) -> None:
        """Merge a table into the tree at a location, key by key; lists and single values are replaced as a whole."""
        under: Any = self.tree
        for key in at:
            under = under[key]
        for key, value in table.items():
            location = (*at, key)
            if not isinstance(value, dict):
                self._put(under, value, location, source)
                continue
            if not isinstance(under.get(key), dict) or (location == FIRING and _own_pattern(value)):
                self._put(under, {}, location, source)
            self.lay(value, source, location)

    def put(self, location: Location, value: object, source: Source) -> None:
        """Set one value, creating the tables above it.

        Raises
        ------
        PathError
            The location leads through a single value, or past the end of a list.
        """
        holder: Any = self.tree
        way: Location = ()
        for key in location[:-1]:
            step = _entry(holder, key, way)
            way = (*way, step)
            if isinstance(holder, dict) and step not in holder:
                self._put(holder, {}, way, source)
            holder = holder[step]
        self._put(holder, value, (*way, _entry(holder, location[-1], way)), source)

    def source_of(self, location: Location) -> Source:
        """Return the source of the value at `location`, or of the table it would belong to."""
        found = next(location[:n] for n in range(len(location), -1, -1) if location[:n] in self._origins)
        return self._origins[found]

    def newest_first(self, sources: list[Source]) -> list[str]:
        """Return the distinct names of `sources`, the latest first."""
        return sorted({s.name for s in sources}, key=self._order.index, reverse=True)

    def sources_within(self, location: Location) -> list[Source]:
        """Return every source of the value at `location` and of values inside it."""
        inside = [s for where, s in self._origins.items() if where[: len(location)] == location]
        return [self.source_of(location), *inside]

    def _put(self, holder: Holder, value: object, location: Location, source: Source) -> None:
        key = location[-1]
        if isinstance(holder, list) or key in holder:
            for where in [w for w in self._origins if w[: len(location)] == location]:
                del self._origins[where]
        held = {"preset": value} if location == FIRING and isinstance(value, str) else copy.deepcopy(value)
        if isinstance(holder, list):
            holder[int(key)] = held
        else:
            holder[str(key)] = held
        if self.source_of(location) != source:
            self._origins[location] = source
        if self._order[-1] != source.name:
            self._order = [name for name in self._order if name != source.name] + [source.name]


def _own_pattern(value: dict[str, Any]) -> bool:
    return not value.keys().isdisjoint({"preset", "sets"})


def _entry(holder: object, key: str | int, location: Location) -> str | int:
    """Return `key` as the step it is in `holder`, the value at `location`."""
    where = ".".join(map(str, location))
    if isinstance(holder, dict):
        return str(key)
    if not isinstance(holder, list):
        raise PathError(f"{where} is a single value and has no {key} in it")
    if not (isinstance(key, int) or (key.isascii() and key.isdecimal() and len(key) < 10)):
        raise PathError(f"{where} is a list: its entries have numbers from 0, not the name {key}")
    if int(key) >= len(holder):
        raise PathError(f"{where} has {len(holder)} {'entry' if len(holder) == 1 else 'entries'}, numbered from 0")
    return int(key)
