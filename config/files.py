"""Reading of TOML files by name or path, with a one-line error message for every problem of a file."""

from __future__ import annotations

import contextlib
import difflib
import errno
import json
import os
import re
import select
import stat
import tomllib
from collections.abc import Iterable, Iterator, Sequence
from contextvars import ContextVar
from dataclasses import dataclass
from importlib.resources import files
from importlib.resources.abc import Traversable
from io import FileIO
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeAlias

from config.errors import WRONG_CALL, UserError
from config.layers import Source
from config.plugins import plugged_folders

Kind: TypeAlias = Literal["robots", "worlds", "models", "runs", "missions", "studies"]
"""Kind of a file, and the folder of the shipped files of that kind."""

SIZE_MAX = 1 << 18
"""Largest settings file, bytes: far more than a person writes, less than a recording given by mistake."""

PIPE_WAIT_S = 5.0
"""Timeout for a pipe or a device given instead of a file, s."""

DEPTH_MAX = 12
"""Deepest nesting of tables and lists; the schema needs six."""


_DOCUMENTS_READ: ContextVar[dict[DocumentRead, None] | None] = ContextVar("documents_read", default=None)

_IN_PLACE: ContextVar[tuple[Path, bytes] | None] = ContextVar("in_place", default=None)

_KEY = r"""(?:(?<![A-Za-z0-9_-])[A-Za-z0-9_-]++|"(?:[^"\\\n]|\\.){0,256}+"|'[^'\n]{0,256}+')"""
_LONG_KEY = re.compile(rf"{_KEY}(?:[ \t]*+\.[ \t]*+{_KEY}){{31}}")
"""A dotted key of 32 parts. The pattern does not backtrack."""


class ConfigError(UserError):
    """Invalid settings: one line for each problem, ready to be shown to the user."""

    exit_code = WRONG_CALL

    def __init__(self, *problems: str) -> None:
        super().__init__("\n".join(problems))
        self.problems = problems


class TomlSyntaxError(ConfigError):
    """Text that is not valid TOML."""


@dataclass(frozen=True)
class Document:
    """A parsed file with its source."""

    table: dict[str, Any]
    source: Source


class DocumentRead(NamedTuple):
    """A settings file that was read."""

    kind: Kind
    name: str
    """As errors name it."""
    path: Path | None
    """Absolute; None if it is shipped."""


def list_shipped(kind: Kind) -> tuple[str, ...]:
    """Return the names of the files of a kind that are shipped or that installed packages add, in order."""
    return tuple(sorted(_shipped_files(kind)))


def read_shipped(read: DocumentRead) -> bytes:
    """Return a file that was read and has no path, since it is shipped or an installed package's."""
    return _shipped_files(read.kind)[Path(read.name).stem].read_bytes()


def _shipped_files(kind: Kind) -> dict[str, Traversable]:
    """Return the files of a kind by their names; a shipped one takes precedence."""
    found = (entry for folder in (*plugged_folders(kind)[0], files("config") / kind) for entry in folder.iterdir())
    return {entry.name.removesuffix(".toml"): entry for entry in found if entry.name.endswith(".toml")}


def names_a_path(name: str | os.PathLike[str]) -> bool:
    """Return whether a name is the path of a file, not that of a shipped one."""
    return not isinstance(name, str) or name.endswith(".toml") or "/" in name or os.sep in name


def read_document(kind: Kind, name: str | os.PathLike[str], named_by: Source | None = None) -> Document:
    """Return the parsed TOML file of a shipped name or a path.

    Parameters
    ----------
    kind
        Kind of the file: the folder in which a bare name is looked up, and its name in errors.
    name
        A bare name, or a path, which ends in .toml or contains a slash. A path is relative to the folder of
        `named_by`, or to the working directory.
    named_by
        Source that names the file; None if the user named it directly.

    Raises
    ------
    ConfigError
        The file does not exist, cannot be read, or is not TOML.
    """
    if not names_a_path(name):
        return _read_shipped(kind, str(name), named_by)
    path = (Path() if named_by is None else named_by.base) / name
    shown = one_line(str(path))
    try:
        data = read_file(path)
    except FileNotFoundError:
        by = "" if named_by is None else f"; named by {named_by.name}"
        raise ConfigError(f"{shown}: file not found{by}; {_known(kind)}") from None
    except IsADirectoryError:
        raise ConfigError(f"{shown}: is a directory, not a TOML file") from None
    except TimeoutError as error:
        raise ConfigError(f"{shown}: {error.strerror}") from None
    except OSError as error:
        raise ConfigError(f"{shown}: cannot be read: {error.strerror or error}") from None
    except ValueError as error:  # a NUL or a lone surrogate in the path
        raise ConfigError(f"{shown}: not a path: {one_line(str(error))}") from None
    _note(DocumentRead(kind, shown, Path.cwd() / path))
    return Document(parse_document(data, shown), Source(shown, path.parent))


@contextlib.contextmanager
def noting_files_read() -> Iterator[None]:
    """Note during the block which files are read, for `documents_read` and `files_read`."""
    token = _DOCUMENTS_READ.set({})
    try:
        yield
    finally:
        _DOCUMENTS_READ.reset(token)


def documents_read() -> tuple[DocumentRead, ...]:
    """Return the settings files that this command has read, shipped ones too, each once, in order."""
    return tuple(_DOCUMENTS_READ.get() or ())


def files_read() -> frozenset[Path]:
    """Return the paths of the files that this command has read, besides shipped ones: no output may be one."""
    return frozenset(read.path for read in documents_read() if read.path is not None)


def parse_document(data: bytes, shown: str) -> dict[str, Any]:
    """Return the table of a TOML file given as bytes.

    Raises
    ------
    ConfigError
        The bytes are too many, not UTF-8 or not TOML; the message has line and column.
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
    """Return the table of a TOML text; refuse deep nesting and integers beyond 64 bits.

    Raises
    ------
    TomlSyntaxError
        The text is not TOML; the message has line and column.
    ConfigError
        The text is TOML but holds what no setting can.
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
    """Return `text`, quoted and escaped if it holds unprintable characters."""
    return text if text.isprintable() else json.dumps(text)


def utf8(text: str) -> str:
    r"""Return `text` with what UTF-8 cannot encode escaped: the bytes of a file name may be anything.

    Python keeps such a byte as a lone surrogate, which no JSON and no other text file can hold.
    """
    return text.encode(errors="backslashreplace").decode()


def is_utf8(text: str) -> bool:
    """Return whether UTF-8 can encode `text`."""
    return utf8(text) == text


def dotted(location: Iterable[str | int]) -> str:
    """Return a location as the user writes it: keys and numbers joined by dots."""
    keys = (k if isinstance(k, str) and re.fullmatch(r"[A-Za-z0-9_-]+", k) else json.dumps(k) for k in location)
    text = ".".join(keys)
    return text if len(text) <= 120 else text[:119] + "…"


def did_you_mean(word: str, known: Sequence[str]) -> str:
    """Return `; did you mean …?` with the known name nearest to `word`, or an empty string."""
    lower = {k.lower(): k for k in known}
    near = difflib.get_close_matches(word.lower()[:80], lower, n=1, cutoff=0.6)
    return f"; did you mean {lower[near[0]]}?" if near else ""


def open_input(path: str | os.PathLike[str]) -> FileIO:
    """Open a file, a pipe or a device for reading, unbuffered.

    Raises
    ------
    TimeoutError
        It is a pipe or a device from which nothing came for `PIPE_WAIT_S`.
    IsADirectoryError
        The path is a directory.
    OSError
        It cannot be read.
    ValueError
        The path holds a NUL or a lone surrogate.
    """
    fd = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NOCTTY | os.O_NONBLOCK)
    try:
        file = FileIO(fd)
    except OSError:  # a directory
        os.close(fd)
        raise
    try:
        await_data(file)
        os.set_blocking(fd, True)
    except OSError:
        file.close()
        raise
    return file


def await_data(file: FileIO) -> None:
    """Return when the next read of a file does not block: at once unless it is a pipe or a device.

    Raises
    ------
    TimeoutError
        Nothing came for `PIPE_WAIT_S`.
    """
    if not stat.S_ISREG(os.fstat(file.fileno()).st_mode) and not select.select([file], [], [], PIPE_WAIT_S)[0]:
        raise TimeoutError(errno.ETIMEDOUT, f"is a pipe from which nothing came for {PIPE_WAIT_S:g} s; give a file")


@contextlib.contextmanager
def in_place_of(path: Path, data: bytes) -> Iterator[None]:
    """Let `read_file` return other bytes than a file holds, to find out what a change of it would mean.

    The file itself is not changed. One file at a time: an inner block hides the outer one.

    The path is absolute, and compared as it is written, without following links.
    """
    token = _IN_PLACE.set((path, data))
    try:
        yield
    finally:
        _IN_PLACE.reset(token)


def read_file(path: Path) -> bytes:
    """Return a settings file's bytes, up to one more than allowed; raises as `open_input`."""
    changed = _IN_PLACE.get()
    if changed is not None and Path.cwd() / path == changed[0]:
        return changed[1][: SIZE_MAX + 1]
    with open_input(path) as file:
        data, more = bytearray(), b" "
        while more and len(data) <= SIZE_MAX:
            await_data(file)
            more = file.read(SIZE_MAX + 1 - len(data)) or b""
            data += more
    return bytes(data)


def _note(read: DocumentRead) -> None:
    if (noted := _DOCUMENTS_READ.get()) is not None:
        noted[read] = None


def _read_shipped(kind: Kind, name: str, named_by: Source | None) -> Document:
    """Return the shipped file of a bare name."""
    known = _shipped_files(kind)
    if name in known:
        data = known[name].read_bytes()
        shown = f"{kind}/{name}.toml"
        _note(DocumentRead(kind, shown, None))
        return Document(parse_document(data, shown), Source(shown))
    what = "study" if kind == "studies" else kind.removesuffix("s")
    shown = f'{what} "{one_line(name)[:80]}"'
    where = shown if named_by is None else f"{named_by.name}: {shown}"
    hint = did_you_mean(name, tuple(known)) + _file_hint(name, Path() if named_by is None else named_by.base)
    raise ConfigError(f"{where}: no such {what}{hint}; {_known(kind)}; a path ends in .toml or contains a slash")


def _file_hint(name: str, base: Path) -> str:
    """Return a hint if there is a file that the user may have meant by a bare name, or an empty string."""
    try:
        found = next((n for n in (name, f"{name}.toml") if name and (base / n).is_file()), None)
    except (OSError, ValueError):  # not a valid file name
        return ""
    return f"; a file is given by its path: ./{one_line(found)}" if found else ""


def _known(kind: Kind) -> str:
    return f"known {kind}: {', '.join(list_shipped(kind))}{plugged_folders(kind)[1]}"


def _placed(message: str, text: str) -> str:
    """Return a message of tomllib with its position moved to the front."""
    what, _, place = message.rpartition(" (at ")
    place = place.removesuffix(")")
    if place == "end of document":
        line = text.count("\n") + 1
        place = f"line {line}, column {len(text) - text.rfind(chr(10))} (end of the file)"
    return one_line(f"{place}: {what}" if what else message)


def _refuse_long_keys(text: str, shown: str) -> None:
    """Refuse long dotted keys before parsing: tomllib's time and memory grow with the square of their length."""
    found = _LONG_KEY.search(text)
    if found is not None:
        line = text.count("\n", 0, found.start()) + 1
        begin = ".".join(found[0][:60].split(".")[:3])
        raise ConfigError(f"{shown}: line {line}: {one_line(begin)}.…: lists or tables are nested too deeply")


def _refuse_extremes(table: dict[str, Any], shown: str) -> None:
    """Refuse deep nesting and integers beyond 64 bits."""
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
