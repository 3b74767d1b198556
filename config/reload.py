"""A changed configuration for a process that runs: taken over whole, or not at all.

A robot that is half on its old settings and half on its new ones is one that nobody configured. So the new settings
are validated whole first; then every difference must be one that a running process can follow; and only then do they
take the old ones' place, in one assignment. On any error the last good ones stay in force.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Final

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
        "ring.firing",
    }
)
"""Settings, and sections of them, that a running process follows. Everything else sizes an array, opens a port or
describes a robot that does not change while it drives: it needs a restart, and so does a new setting until it is
entered here. Models are followed where further ones come after those from before: see `Difference.live`."""


MODELS: Final = ("models",)


@dataclass(frozen=True, slots=True)
class Difference:
    """A value that is not the same in two settings."""

    location: Location
    before: object
    after: object

    @property
    def path(self) -> str:
        """The dotted path, as in a file."""
        return dotted(self.location)

    @property
    def live(self) -> bool:
        """Whether a running process follows the change.

        Further models are further explanations of what was heard, and nothing that is remembered says otherwise. A
        model that goes or changes leaves objects behind that are called by it, so that needs a restart.
        """
        if self.location == MODELS and isinstance(self.before, tuple) and isinstance(self.after, tuple):
            return self.before == self.after[: len(self.before)]
        keys = [str(key) for key in self.location]
        return any(".".join(keys[:n]) in LIVE_SETTINGS for n in range(1, len(keys) + 1))

    def __str__(self) -> str:
        return f"{self.path}: {_shown(self.before)} → {_shown(self.after)}"


@dataclass(frozen=True, slots=True)
class ReloadResult:
    """What became of an attempt."""

    settings: Settings
    """In force from now on: the new ones whole, or the very ones from before."""
    changed: tuple[Difference, ...] = ()
    """What is new."""
    problems: tuple[str, ...] = field(default=())
    """Why nothing was taken over, one line each; empty where it was."""


def reload(current: Settings, propose: Callable[[], Settings]) -> ReloadResult:
    """Return the settings in force after an attempt to change them.

    Parameters
    ----------
    current
        In force so far; never touched.
    propose
        Loads and validates the new ones whole; raises ConfigError where they are no good.
    """
    try:
        proposed = propose()
    except ConfigError as error:
        return ReloadResult(current, problems=error.problems)
    changed = tuple(differences(current, proposed))
    fixed = tuple(f"{d}: needs a restart" for d in changed if not d.live)
    if fixed:
        return ReloadResult(current, problems=fixed)
    return ReloadResult(proposed, changed) if changed else ReloadResult(current)


def differences(before: object, after: object, at: Location = ()) -> Iterator[Difference]:
    """Yield every value that differs, in the order of the schema; lists are compared whole."""
    if isinstance(before, BaseModel) and type(before) is type(after):
        for key in type(before).model_fields:
            yield from differences(getattr(before, key), getattr(after, key), (*at, key))
    elif before != after:
        yield Difference(at, before, after)


def _shown(value: object) -> str:
    if value is None:
        return "not given"
    return "{…}" if isinstance(value, BaseModel) else shown(_plain(value))


def _plain(value: object) -> object:
    """Return models within lists as the tables that they were."""
    if isinstance(value, tuple):
        return [_plain(v) for v in value]
    return value.model_dump() if isinstance(value, BaseModel) else value
