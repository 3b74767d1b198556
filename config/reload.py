"""Reload of the configuration of a running process: the new settings apply completely or not at all.

The new settings are validated as a whole first. Then every difference must be one that a running process can apply.
Only then do they replace the old ones, in one assignment. On any error the previous settings stay in force.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Final, TypeGuard

from pydantic import BaseModel

from config.files import ConfigError, dotted
from config.layers import Location
from config.problems import shown
from config.settings import Settings

LIVE_SETTINGS: Final = frozenset(
    {
        "behaviors",
        "cycle.perception_budget_s",
        "perception.bayes.attempts_per_firing",
        "perception.bayes.fresh_share",
        "perception.bayes.polygon_quanta_per_firing",
        "perception.bayes.quanta_per_firing",
        "perception.bayes.report_probability",
        "perception.bayes.report_probability_near",
        "perception.clusters.segments_min",
        "perception.clusters.threshold_m",
        "perception.map.age_max_s",
        "perception.map.contradiction_margin_m",
        "perception.recognition",
        "perception.relaxation",
        "perception.segments",
        "places",
        "ring.firing",
    }
)
"""Settings and sections that a running process can apply at any time. All others size an array, open a port or
describe the robot itself, so they need a restart, as does a new setting until it is listed here. Models can be
appended, see `Difference.live`."""
MAP: Final = frozenset({"perception.localization.known_room"})
"""The known room. It can be applied to a robot that stands: all places in the map mean something else then."""


MODELS: Final = ("models",)


@dataclass(frozen=True, slots=True)
class Difference:
    """A value that differs between two settings."""

    location: Location
    before: object
    after: object

    @property
    def path(self) -> str:
        """The dotted path, as in a file."""
        return dotted(self.location)

    @property
    def live(self) -> bool:
        """Whether a running process can apply the change at any time.

        Appended models are further hypotheses, and the existing state stays valid. Removing or changing a model needs
        a restart, because existing objects refer to it.
        """
        if self.location == MODELS and isinstance(self.before, tuple) and isinstance(self.after, tuple):
            return self.before == self.after[: len(self.before)]
        return self.is_of(LIVE_SETTINGS)

    def is_of(self, sections: frozenset[str]) -> bool:
        """Return whether the change lies in one of these settings or sections."""
        keys = [str(key) for key in self.location]
        return any(".".join(keys[:n]) in sections for n in range(1, len(keys) + 1))

    def __str__(self) -> str:
        before, after = self.before, self.after
        if _is_tables(before) and _is_tables(after):
            if len(before) == len(after):
                differ = sum(one != other for one, other in zip(before, after, strict=True))
                return f"{self.path}: {differ} of {len(after)} entries"
            return f"{self.path}: {len(before)} → {len(after)} entries"
        return f"{self.path}: {_shown(before)} → {_shown(after)}"


@dataclass(frozen=True, slots=True)
class ReloadResult:
    """Result of a reload."""

    settings: Settings
    """Settings in force from now on: the new ones, or the identical previous ones."""
    changed: tuple[Difference, ...] = ()
    """Differences that were applied."""
    problems: tuple[str, ...] = field(default=())
    """Why the new settings were refused, one line each; empty if they were applied."""


def reload(current: Settings, propose: Callable[[], Settings], also: frozenset[str] = frozenset()) -> ReloadResult:
    """Return the settings in force after an attempt to change them.

    `propose` reads the new settings, and raises ConfigError if they are invalid. What `also` names can be applied now
    besides `LIVE_SETTINGS`.
    """
    try:
        proposed = propose()
    except ConfigError as error:
        return ReloadResult(current, problems=error.problems)
    changed = tuple(differences(current, proposed))
    fixed = tuple(f"{d}: needs a restart" for d in changed if not (d.live or d.is_of(also)))
    if fixed:
        return ReloadResult(current, problems=fixed)
    return ReloadResult(proposed, changed) if changed else ReloadResult(current)


def differences(before: object, after: object, at: Location = ()) -> Iterator[Difference]:
    """Yield every value that differs, in the order of the schema; lists are compared as a whole.

    `at` is where both are in the settings.
    """
    if isinstance(before, BaseModel) and type(before) is type(after):
        for key in type(before).model_fields:
            yield from differences(getattr(before, key), getattr(after, key), (*at, key))
    elif before != after:
        yield Difference(at, before, after)


def _is_tables(value: object) -> TypeGuard[tuple[BaseModel, ...]]:
    """Return whether a value is a list of tables, which have no short text."""
    return isinstance(value, tuple) and all(isinstance(one, BaseModel) for one in value)


def _shown(value: object) -> str:
    if value is None:
        return "not given"
    return "{…}" if isinstance(value, BaseModel) else shown(_plain(value))


def _plain(value: object) -> object:
    """Return a value with the models in lists as tables."""
    if isinstance(value, tuple):
        return [_plain(v) for v in value]
    return value.model_dump() if isinstance(value, BaseModel) else value
