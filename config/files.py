"""From a name or a path to a parsed TOML table, and one clear line for everything that can be wrong with a file."""

from __future__ import annotations

import difflib
import json
import os
import re
import select
import stat
import tomllib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal, TypeAlias

from config.errors import WRONG_CALL, UserError
from config.layers import Source

Kind: TypeAlias = Literal["robots", "worlds", "models", "runs"]
"""What a file is about, and the folder the shipped ones of that kind lie in."""

SIZE_MAX = 1 << 18
"""Bytes. Nothing a person writes comes near; /dev/zero and a recording given by mistake go far beyond."""

PIPE_WAIT_S = 5.0
"""Patience with a pipe or a device that is named instead of a file."""

DEPTH_MAX = 12
"""Tables and lists within one another. The schema needs six."""


_KEY = r"""(?:(?<![A-Za-z0-9_-])[A-Za-z0-9_-]++|"(?:[^"\\\n]|\\.){0,256}+"|'[^'\n]{0,256}+')"""
_LONG_KEY = re.compile(rf"{_KEY}(?:[ \t]*+\.[ \t]*+{_KEY}){{31}}")
"""A dotted key of 32 parts. Nothing in it backtracks, and parts too long for it are too few to matter."""


class ConfigError(UserError):
    """The settings are wrong: one line for each problem, ready to be shown to the user.

    Parameters
    ----------
    problems
        One line each; never empty.
    """

    exit_code = WRONG_CALL

    def __init__(self, *problems: str) -> None:
        super().__init__("\n".join(problems))
        self.problems = problems


class TomlSyntaxError(ConfigError):
    """Text that is not TOML."""


@dataclass(frozen=True)
class Document:
    """A parsed file and where it came from."""

    table: dict[str, Any]
    source: Source


def list_shipped(kind: Kind) -> tuple[str, ...]:
    """Return the names of the shipped files of a kind, in alphabetical order."""
    names = (entry.name for entry in (files("config") / kind).iterdir())
    return tuple(sorted(n.removesuffix(".toml") for n in names if n.endswith(".toml")))


def read_document(kind: Kind, name: str | os.PathLike[str], named_by: Source | None = None) -> Document:
    """Read a TOML file given by the name of a shipped one or by its path.

    Parameters
    ----------
    kind
        What the file is about: where a bare name is looked up, and what an error calls it.
    name
        A bare name, or a path: whatever ends in .toml or contains a slash. A path is relative to the folder of
        `named_by`, or to the working directory.
    named_by
        The source that names the file; None where the user did so directly.

    Raises
    ------
    ConfigError
        Where there is no such file, or it cannot be read, or is not TOML.
    """
    is_path = not isinstance(name, str) or name.endswith(".toml") or "/" in name or os.sep in name
    if not is_path:
        return _read_shipped(kind, str(name), named_by)
    path = (Path() if named_by is None else named_by.base) / name
    shown = one_line(str(path))
    try:
        data = _read(path)
    except FileNotFoundError:
        by = "" if named_by is None else f"; named by {named_by.name}"
        raise ConfigError(f"{shown}: file not found{by}; {_known(kind)}") from None
    except IsADirectoryError:
        raise ConfigError(f"{shown}: is a directory, not a TOML file") from None
    except TimeoutError:
        raise ConfigError(f"{shown}: is a pipe from which nothing came for {PIPE_WAIT_S:g} s; give a file") from None
    except OSError as error:
        raise ConfigError(f"{shown}: cannot be read: {error.strerror or error}") from None
    except ValueError as error:  # a NUL or a lone surrogate in the path
        raise ConfigError(f"{shown}: not a path: {one_line(str(error))}") from None
    return Document(parse_document(data, shown), Source(shown, path.parent))


def parse_document(data: bytes, shown: str) -> dict[str, Any]:
    """Parse the bytes of a TOML file.

    Raises
    ------
    ConfigError
        Where they are too many, not UTF-8 or not TOML, with line and column.
    """
    if len(data) > SIZE_MAX:
        raise ConfigError(f"{shown}: larger than {SIZE_MAX >> 10} KiB, so not a settings file")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise ConfigError(
            f"{shown}: line {line}: byte 0x{error.object[error.start]:02x} is not UTF-8 text; save the file as UTF-8"
        ) from None
    return parse_toml(text, shown)


def parse_toml(text: str, shown: str) -> dict[str, Any]:
    """Parse TOML text, and refuse what no setting can hold: deep nesting, integers beyond 64 bits.

    Raises
    ------
    TomlSyntaxError
        With line and column of what is not TOML.
    ConfigError
        Where it is, and holds what no setting can.
    """
    _refuse_long_keys(text, shown)
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise TomlSyntaxError(f"{shown}: {_placed(str(error), text)}") from None
    except RecursionError:
        raise ConfigError(f"{shown}: lists or tables are nested too deeply") from None
    except ValueError:  # Python refuses to convert integers of thousands of digits
        raise ConfigError(f"{shown}: holds a number with far too many digits") from None
    _refuse_extremes(table, shown)
    return table


def one_line(text: str) -> str:
    """Return `text`, with quotes and escapes where it would break a line or a terminal."""
    return text if text.isprintable() else json.dumps(text)


def dotted(location: Iterable[str | int]) -> str:
    """Return a location as the user writes it: keys and numbers with dots in between."""
    keys = (k if isinstance(k, str) and re.fullmatch(r"[A-Za-z0-9_-]+", k) else json.dumps(k) for k in location)
    text = ".".join(keys)
    return text if len(text) <= 120 else text[:119] + "…"


def did_you_mean(word: str, known: Sequence[str]) -> str:
    """Return `; did you mean …?` with the known name nearest to `word`, or nothing where none is near."""
    lower = {k.lower(): k for k in known}
    near = difflib.get_close_matches(word.lower()[:80], lower, n=1, cutoff=0.6)
    return f"; did you mean {lower[near[0]]}?" if near else ""


def _read(path: Path) -> bytes:
    """Return the file's bytes, one more than allowed at most; a pipe on which nobody writes ends in TimeoutError."""
    fd = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NOCTTY | os.O_NONBLOCK)
    with os.fdopen(fd, "rb", buffering=0) as file:
        kind = os.fstat(fd).st_mode
        if stat.S_ISDIR(kind):
            raise IsADirectoryError
        data, more = bytearray(), b" "
        while more and len(data) <= SIZE_MAX:
            if not stat.S_ISREG(kind) and not select.select([fd], [], [], PIPE_WAIT_S)[0]:
                raise TimeoutError
            more = file.read(SIZE_MAX + 1 - len(data)) or b""
            data += more
    return bytes(data)


def _read_shipped(kind: Kind, name: str, named_by: Source | None) -> Document:
    known = list_shipped(kind)
    if name in known:
        data = (files("config") / kind / f"{name}.toml").read_bytes()
        shown = f"{kind}/{name}.toml"
        return Document(parse_document(data, shown), Source(shown))
    what = kind.removesuffix("s")
    shown = f'{what} "{one_line(name)[:80]}"'
    where = shown if named_by is None else f"{named_by.name}: {shown}"
    hint = did_you_mean(name, known) + _file_beside(name, Path() if named_by is None else named_by.base)
    raise ConfigError(f"{where}: no such {what}{hint}; {_known(kind)}; a path ends in .toml or contains a slash")


def _file_beside(name: str, base: Path) -> str:
    """Return a hint where a file lies at hand that the user may have meant by a bare name."""
    try:
        beside = next((n for n in (name, f"{name}.toml") if name and (base / n).is_file()), None)
    except (OSError, ValueError):  # too long for a file's name, or not fit for one
        return ""
    return f"; a file is given by its path: ./{one_line(beside)}" if beside else ""


def _known(kind: Kind) -> str:
    return f"known {kind}: {', '.join(list_shipped(kind))}"


def _placed(message: str, text: str) -> str:
    """Put the place tomllib names behind its message in front of it."""
    what, _, place = message.rpartition(" (at ")
    place = place.removesuffix(")")
    if place == "end of document":
        line = text.count("\n") + 1
        place = f"line {line}, column {len(text) - text.rfind(chr(10))} (end of the file)"
    return one_line(f"{place}: {what}" if what else message)


def _refuse_long_keys(text: str, shown: str) -> None:
    """Refuse a.a.a.… before it is parsed: time and memory that tomllib takes grow with the square of its length."""
    found = _LONG_KEY.search(text)
    if found is not None:
        line = text.count("\n", 0, found.start()) + 1
        begin = ".".join(found[0][:60].split(".")[:3])
        raise ConfigError(f"{shown}: line {line}: {one_line(begin)}.…: lists or tables are nested too deeply")


def _refuse_extremes(table: dict[str, Any], shown: str) -> None:
    todo: list[tuple[tuple[str | int, ...], Any]] = [((), table)]
    while todo:
        location, value = todo.pop()
        if len(location) > DEPTH_MAX:
            raise ConfigError(f"{shown}: {dotted(location[:3])}.…: lists or tables are nested too deeply")
        if isinstance(value, int) and not -(2**63) <= value < 2**63:
            raise ConfigError(f"{shown}: {dotted(location)}: an integer beyond 64 bits")
        if isinstance(value, dict):
            todo.extend(((*location, key), inner) for key, inner in value.items())
        elif isinstance(value, list):
            todo.extend(((*location, number), inner) for number, inner in enumerate(value))
