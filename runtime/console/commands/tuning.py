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
from config.load import ConfigError, parse_text, with_room, with_value
from config.model import ModelConfig
from config.places import PlacesConfig
from config.problems import shown
from config.reload import MAP, Difference, ReloadResult, differences
from config.settings import Settings
from config.world import WorldConfig
from runtime.console.commands.command_error import CommandError
from runtime.cycle.live_settings import LiveSettings, PrepareSettings
from runtime.support.pattern_check import refuse_undrivable

SOURCE: Final = "page"
"""What error messages of the configuration call the source of a value."""
PRESET: Final = ("ring", "firing", "preset")


class Tuning:
    """Changes of the live settings by an operator.

    `prepare` is awaited before a further model is recognised; `on_change` gets what an operator has changed or
    undone. The port of an emulated robot is left out of a saved file.
    """

    def __init__(
        self,
        live_settings: LiveSettings,
        prepare: PrepareSettings,
        on_change: Callable[[tuple[Difference, ...]], None],
        *,
        emulated: bool,
    ) -> None:
        self._live_settings = live_settings
        self._prepare = prepare
        self._on_change = on_change
        self._emulated = emulated

    @property
    def current(self) -> Settings:
        """The settings in force."""
        return self._live_settings.current

    def set(self, path: str, value: bool | float | str | None) -> tuple[Difference, ...]:
        """Change one value; return what changed.

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
            given = value  # type: ignore[assignment]  # a table above, one value here
        return self._apply(path, lambda: with_value(self.current, SOURCE, location, given), f" = {shown(value)}")

    async def add_model(self, toml: str) -> ModelConfig:
        """Recognise a further model once its kernels are compiled; return it.

        Raises
        ------
        CommandError
            The model is invalid, has the name of another one, or is one too many.
        """
        try:
            model = parse_text(ModelConfig, toml, "model")
        except ConfigError as error:
            raise CommandError(str(error), "toml") from None

        def proposed() -> Settings:
            models = (*self.current.models, model)
            return with_value(self.current, SOURCE, ("models",), [m.model_dump(mode="json") for m in models])

        problem = await self._prepare(self.current, self._validated("toml", proposed).settings)
        if problem is not None:
            raise CommandError(problem, "toml")
        self._apply("toml", proposed)
        return model

    async def set_map(self, toml: str | None, refusal: Callable[[], str | None]) -> None:
        """Find the robot in a known room from now on, as after a start with `--map`; its places come with it.

        A `toml` of None forgets the room that is known. `refusal` returns why no map can be changed now, None if one
        can.

        Raises
        ------
        CommandError
            The world is invalid or has no surface, drift is corrected otherwise, or the map cannot be changed now.
        """

        def proposed() -> Settings:
            room = None if toml is None else parse_text(WorldConfig, toml, "map")
            places = PlacesConfig() if room is None else room.places()
            return with_room(self.current.model_copy(update={"places": places}), room, "map")

        def result() -> Settings:
            """Return the settings with the room; raises `CommandError` where they are refused."""
            why = refusal()
            if why is not None:
                raise CommandError(why, "toml")
            checked = self._live_settings.check(proposed, MAP)
            if checked.problems:
                raise CommandError("; ".join(checked.problems), "toml")
            return checked.settings

        problem = await self._prepare(self.current, result())
        if problem is not None:
            raise CommandError(problem, "toml")
        changed = self._live_settings.apply(result(), can_undo=False)
        if changed:
            self._on_change(changed)

    def set_places(self, places: PlacesConfig) -> bool:
        """Put other places in force; return whether anything changed. `undo` does not concern them."""
        changed = self._live_settings.apply(self.current.model_copy(update={"places": places}), can_undo=True)
        if changed:
            self._on_change(changed)
        return bool(changed)

    def undo(self) -> tuple[Difference, ...]:
        """Undo the last change; return what changed.

        Raises
        ------
        CommandError
            There is no change to undo.
        """
        changed = self._live_settings.undo()
        if not changed:
            raise CommandError("there is no change to undo")
        self._on_change(changed)
        return changed

    def saved(self) -> str:
        """Return all settings as the text of a run file that begins with the changes since the start."""
        table: dict[str, Any] = without_none(self.current.model_dump(mode="json"))
        if self._emulated:
            table["link"].pop("port", None)
        changes = [f"#   {change}\n" for change in differences(self._live_settings.initial, self.current)]
        head = "# Saved from the operator console.\n" + ("# Changed there:\n" if changes else "") + "".join(changes)
        return f"{head}\n{tomli_w.dumps(table)}"

    def _firing(self) -> dict[str, Any]:
        return self.current.ring.firing.model_dump(mode="json")

    def _apply(self, path: str, propose: Callable[[], Settings], given: str = "") -> tuple[Difference, ...]:
        """Put a change into force; return what changed."""
        result = self._validated(path, propose, given)
        changed = self._live_settings.apply(result.settings, can_undo=True)
        if changed:
            self._on_change(changed)
        return changed

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
                refuse_undrivable(settings)
            except UserError as error:
                raise ConfigError(str(error)) from error
            return settings

        result = self._live_settings.check(proposed)
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
