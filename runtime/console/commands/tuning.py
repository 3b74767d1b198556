"""Changing settings from the page: each change validated whole, taken over whole or refused, and taken back again.

What `config.reload` says of a changed file holds here as well: a change that a running process cannot follow is
refused, and on any error the last good settings stay in force.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import tomli_w

from config.errors import UserError
from config.layers import Location
from config.load import MODELS_MAX, ConfigError, parse_model, with_value
from config.model import ModelConfig
from config.problems import shown
from config.reload import Difference, ReloadResult, differences, reload
from config.settings import Settings
from runtime.cli.commands.firing_check import refuse_impossible_firing
from runtime.console.commands.command_error import CommandError
from runtime.cycle.reloader import Ready

UNDO_MAX: Final = 100
PAGE: Final = "page"
"""What the source of a value is called in complaints."""
PRESET: Final = ("ring", "firing", "preset")


class Tuning:
    """The settings in force, and those before them, all with the models of now.

    Parameters
    ----------
    current : Settings
        What the run was started with.
    take_over : callable
        Gets settings that are good and that a running process follows.
    ready : Ready
        Awaited before a further model is looked for.
    emulated : bool
        Whether the port is an emulator's, which nobody wants to find in a file.
    """

    def __init__(
        self, current: Settings, take_over: Callable[[Settings], None], ready: Ready, *, emulated: bool
    ) -> None:
        self.current = current
        self._first = current
        self._take_over = take_over
        self._ready = ready
        self._emulated = emulated
        self._before: list[Settings] = []

    def adopt(self, settings: Settings) -> None:
        """Take note of settings that came from elsewhere; nothing before them can be brought back."""
        self.current = settings
        self._before.clear()

    def set(self, path: str, value: bool | float | str | None) -> tuple[Difference, ...]:
        """Change one value; return what is new.

        Raises
        ------
        CommandError
            Why not; its field is `path`.
        """
        location: Location = tuple(path.split("."))
        if location == PRESET:
            # Naming a pattern replaces one of one's own, as in a file.
            location, given = PRESET[:-1], {**self._firing(), "preset": value, "sets": None}
        else:
            given = value  # type: ignore[assignment]
        return self._try(path, lambda: with_value(self.current, PAGE, location, given), f" = {shown(value)}")

    async def add_model(self, toml: str) -> ModelConfig:
        """Look for a further model, as soon as this process can; return it.

        Raises
        ------
        CommandError
            Why not.
        """
        try:
            model = parse_model(toml, "model")
        except ConfigError as error:
            raise CommandError(str(error), "toml") from None

        def proposed() -> Settings:
            models = (*self.current.models, model)
            if len(models) > MODELS_MAX:
                raise CommandError(
                    f"{MODELS_MAX} models are looked for already: that is the most there may be", "toml"
                )
            return with_value(self.current, PAGE, ("models",), [m.model_dump(mode="json") for m in models])

        validate = await self._ready(self.current, self._weighed("toml", proposed).settings)
        if validate is not None:
            raise CommandError(validate, "toml")
        before = self._before
        self._try("toml", proposed)
        # A model cannot be forgotten while the robot runs: what is taken back from now on are other changes.
        self._before = [settings.model_copy(update={"models": self.current.models}) for settings in before]
        return model

    def undo(self) -> tuple[Difference, ...]:
        """Take the last change back; return what is new.

        Raises
        ------
        CommandError
            There is nothing to take back.
        """
        if not self._before:
            raise CommandError("there is no change to take back")
        before = self._before.pop()
        changed = tuple(differences(self.current, before))
        self.current = before
        self._take_over(before)
        return changed

    def saved(self) -> str:
        """Return all settings as a run file, with what was changed since the start in its first lines."""
        table: dict[str, Any] = without_none(self.current.model_dump(mode="json"))
        if self._emulated:
            table["link"].pop("port", None)
        changes = [f"#   {change}\n" for change in differences(self._first, self.current)]
        head = "# Saved from the operator console.\n" + ("# Changed there:\n" if changes else "") + "".join(changes)
        return f"{head}\n{tomli_w.dumps(table)}"

    def _firing(self) -> dict[str, Any]:
        return self.current.ring.firing.model_dump(mode="json")

    def _try(self, path: str, propose: Callable[[], Settings], given: str = "") -> tuple[Difference, ...]:
        outcome = self._weighed(path, propose, given)
        if outcome.changed:
            self._before = [*self._before[-UNDO_MAX + 1 :], self.current]
            self.current = outcome.settings
            self._take_over(outcome.settings)
        return outcome.changed

    def _weighed(self, path: str, propose: Callable[[], Settings], given: str = "") -> ReloadResult:
        """Return what a change comes to, or refuse it; nothing is taken over."""

        def proposed() -> Settings:
            settings = propose()
            try:
                refuse_impossible_firing(settings)
            except UserError as complaint:
                raise ConfigError(str(complaint)) from complaint
            return settings

        outcome = reload(self.current, proposed)
        if outcome.problems:
            raise CommandError("; ".join(_beside(path, given, line) for line in outcome.problems), path)
        return outcome


def _beside(path: str, given: str, line: str) -> str:
    """Return a complaint as it is told beside its field, which need not be named again."""
    text = line.removeprefix(f"{PAGE}: ").removeprefix(f"{path}{given}: ")
    parent = path.rpartition(".")[0]
    return text.removeprefix(f"{parent}: ") if parent else text


def without_none(value: Any) -> Any:  # noqa: ANN401 - whatever JSON holds
    """Return a tree without what is None, which TOML cannot say: what is not there is not given."""
    if isinstance(value, dict):
        return {key: without_none(inner) for key, inner in value.items() if inner is not None}
    return [without_none(inner) for inner in value] if isinstance(value, list) else value
