"""Single settings from the command line: `--set ring.firing=octets`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from config.files import DEPTH_MAX, ConfigError, TomlSyntaxError, is_utf8, one_line, parse_toml
from config.layers import Layers, Location, PathError, Source

OVERRIDE = Source("--set")


@dataclass(frozen=True)
class Override:
    """A value and its location."""

    location: Location
    value: object
    """Any TOML value."""

    @property
    def names_files(self) -> bool:
        """Whether the value names a file to read, so that it must be applied before files are read."""
        head, depth = self.location[0], len(self.location)
        return (head in ("robot", "world", "models", "mission") and depth == 1) or (head == "models" and depth == 2)


def parse_override(text: str) -> Override:
    """Return the override of a text `dotted.path=value`; the value is TOML, or a string without quotes.

    Raises
    ------
    ConfigError
        The text does not have this form.
    """
    shown = one_line(text) if len(text) <= 60 else one_line(text[:59]) + "…"
    if not is_utf8(text):
        raise ConfigError(f"--set {shown}: is not UTF-8 text")
    path, equals, value = text.partition("=")
    keys = tuple(key.strip() for key in path.split("."))
    if not equals or not all(keys):
        raise ConfigError(f"--set {shown}: must have the form section.key=value, as in --set ring.firing=octets")
    if len(keys) > DEPTH_MAX:
        raise ConfigError(f"--set {shown}: no setting lies that deep")
    return Override(keys, _parse_value(value.strip(), f"--set {shown}"))


def parse_overrides(texts: Sequence[str]) -> tuple[list[Override], list[Override], list[str]]:
    """Return the overrides that name files, those of single values, and a line for each text that is wrong."""
    names: list[Override] = []
    values: list[Override] = []
    problems: list[str] = []
    for text in texts:
        try:
            change = parse_override(text)
        except ConfigError as error:
            problems += error.problems
        else:
            (names if change.names_files else values).append(change)
    return names, values, problems


def apply_overrides(overrides: list[Override], layers: Layers) -> list[str]:
    """Apply the overrides to `layers`; return one line for each that cannot be applied."""
    problems = []
    for override in overrides:
        try:
            layers.put(override.location, override.value, OVERRIDE)
        except PathError as error:
            path = one_line(".".join(map(str, override.location)))
            problems.append(f"--set: {path}: {one_line(str(error))}")
    return problems


def _parse_value(text: str, shown: str) -> object:
    """Return the value that TOML reads in a text, else the text itself; `shown`: how an error names it."""
    if "\n" in text or "\r" in text:
        return text
    try:
        return parse_toml(f"value = {text}", shown)["value"]
    except TomlSyntaxError:
        if text.startswith(("[", "{", '"', "'")):
            raise ConfigError(
                f"{shown}: the value begins like a TOML list, table or string but is none; mind the shell's quoting"
            ) from None
        return text
