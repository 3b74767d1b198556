"""Live settings changed from the page: each change is validated as a whole, applied or refused, and can be undone.

The rules are those of a changed file (`config.reload`): a change that a running process cannot follow is refused, and
after any error the last valid settings stay in force.
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
from drivers.registry import make_driver
from runtime.console.commands.command_error import CommandError
from runtime.cycle.reloader import Ready

UNDO_MAX: Final = 100
"""Changes that can be undone."""
SOURCE: Final = "page"
"""What error messages of the configuration call the source of a value."""
PRESET: Final = ("ring", "firing", "preset")


class Tuning:
    """The settings in force and those before them.

    Parameters
    ----------
    current : Settings
        With which the run was started.
    take_over : callable
        Gets settings that are valid and that a running process can follow.
    ready : Ready
        Awaited before a further model is recognised.
    emulated : bool
        Whether the port is an emulator's, which a saved file leaves out.
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
        """Continue from settings that were changed elsewhere; earlier changes can no longer be undone."""
        self.current = settings
        self._before.clear()

    def set(self, path: str, value: bool | float | str | None) -> tuple[Difference, ...]:
        """Change one value; return what changed.

        Parameters
        ----------
        path : str
            The dotted name of the setting.
        value : bool, int, float, str or None
            Its new value.

        Raises
        ------
        CommandError
            The settings would be invalid, or need a restart; its field is `path`.
        """
        location: Location = tuple(path.split("."))
        if location == PRESET:
            # As in a file, a preset replaces a firing pattern given as sets.
            location, given = PRESET[:-1], {**self._firing(), "preset": value, "sets": None}
        else:
            given = value  # type: ignore[assignment]
        return self._apply(path, lambda: with_value(self.current, SOURCE, location, given), f" = {shown(value)}")

    async def add_model(self, toml: str) -> ModelConfig:
        """Recognise a further model once its kernels are compiled; return it.

        Raises
        ------
        CommandError
            The model is invalid, has the name of another one, or is one too many.
        """
        try:
            model = parse_model(toml, "model")
        except ConfigError as error:
            raise CommandError(str(error), "toml") from None

        def proposed() -> Settings:
            models = (*self.current.models, model)
            if len(models) > MODELS_MAX:
                raise CommandError(f"{MODELS_MAX} models are recognised already, which is the limit", "toml")
            return with_value(self.current, SOURCE, ("models",), [m.model_dump(mode="json") for m in models])

        problem = await self._ready(self.current, self._validated("toml", proposed).settings)
        if problem is not None:
            raise CommandError(problem, "toml")
        before = self._before
        self._apply("toml", proposed)
        # A model cannot be removed while the robot runs, so undo restores other changes and keeps the models.
        self._before = [settings.model_copy(update={"models": self.current.models}) for settings in before]
        return model

    def undo(self) -> tuple[Difference, ...]:
        """Undo the last change; return what changed.

        Raises
        ------
        CommandError
            There is no change to undo.
        """
        if not self._before:
            raise CommandError("there is no change to undo")
        before = self._before.pop()
        changed = tuple(differences(self.current, before))
        self.current = before
        self._take_over(before)
        return changed

    def saved(self) -> str:
        """Return all settings as the text of a run file that begins with the changes since the start."""
        table: dict[str, Any] = without_none(self.current.model_dump(mode="json"))
        if self._emulated:
            table["link"].pop("port", None)
        changes = [f"#   {change}\n" for change in differences(self._first, self.current)]
        head = "# Saved from the operator console.\n" + ("# Changed there:\n" if changes else "") + "".join(changes)
        return f"{head}\n{tomli_w.dumps(table)}"

    def _firing(self) -> dict[str, Any]:
        return self.current.ring.firing.model_dump(mode="json")

    def _apply(self, path: str, propose: Callable[[], Settings], given: str = "") -> tuple[Difference, ...]:
        """Put a change into force; return what changed."""
        result = self._validated(path, propose, given)
        if result.changed:
            self._before = [*self._before[-UNDO_MAX + 1 :], self.current]
            self.current = result.settings
            self._take_over(result.settings)
        return result.changed

    def _validated(self, path: str, propose: Callable[[], Settings], given: str = "") -> ReloadResult:
        """Return what a change would result in; nothing is put into force.

        Raises
        ------
        CommandError
            The settings would be invalid, or need a restart.
        """

        def proposed() -> Settings:
            settings = propose()
            try:
                make_driver(settings)  # refuses a firing pattern that the robot cannot carry out
            except UserError as error:
                raise ConfigError(str(error)) from error
            return settings

        result = reload(self.current, proposed)
        if result.problems:
            raise CommandError("; ".join(_next_to_field(path, given, line) for line in result.problems), path)
        return result


def _next_to_field(path: str, given: str, line: str) -> str:
    """Return an error message without the names of source and field, because the page shows it next to the field."""
    text = line.removeprefix(f"{SOURCE}: ").removeprefix(f"{path}{given}: ")
    parent = path.rpartition(".")[0]
    return text.removeprefix(f"{parent}: ") if parent else text


def without_none(value: Any) -> Any:  # noqa: ANN401 - any JSON value
    """Return a tree of dicts and lists without the keys whose value is None, which TOML cannot express."""
    if isinstance(value, dict):
        return {key: without_none(inner) for key, inner in value.items() if inner is not None}
    return [without_none(inner) for inner in value] if isinstance(value, list) else value
