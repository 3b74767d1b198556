"""A recording as something to read: what the run was, and its messages one by one, whatever has befallen the file."""

from __future__ import annotations

import contextlib
import mmap
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import orjson
from pydantic import ValidationError

from config.errors import WRONG_CALL, UserError
from config.settings import Settings
from config.world import WorldConfig
from runtime.recording.channels import RUN_INFO, RawMessage, decode
from runtime.recording.mcap_file import PROFILE
from runtime.recording.mcap_scanner import CorruptRegion, McapScanner
from runtime.recording.schema import FORMAT, RunInfo

MAGIC: Final = b"\x89MCAP"
NS_PER_S: Final = 1_000_000_000


class RecordingError(UserError):
    """The file is not a recording or cannot be read; the text is one line for the user."""

    exit_code = WRONG_CALL


@dataclass
class Recording:
    """An open recording.

    Attributes
    ----------
    path : Path
        The file.
    info : RunInfo
        What the run was.
    settings : Settings
        Its settings.
    """

    path: Path
    info: RunInfo
    settings: Settings
    _data: memoryview
    _salvage: McapScanner = field(init=False)

    def __post_init__(self) -> None:
        self._salvage = McapScanner(self._data)

    def messages(self) -> Iterator[RawMessage]:
        """Yield every message that can be read, in the order of the file; may be called again."""
        self._salvage = McapScanner(self._data)
        for chunk in self._salvage.chunks():
            yield from chunk

    def chunks(self, since: int | None = None) -> Iterator[tuple[int, list[RawMessage]]]:
        """Yield the messages chunk by chunk, each with the byte at which to begin to read it again.

        Parameters
        ----------
        since : int, optional
            Such a byte; all of the file has been read once before.
        """
        if since is None:
            self._salvage = McapScanner(self._data)
            for chunk in self._salvage.chunks():
                yield self._salvage.chunk_at, chunk
            return
        salvage = self._salvage
        known = len(salvage.damage)
        for chunk in salvage.chunks(since):
            at = salvage.chunk_at
            del salvage.damage[known:]
            yield at, chunk

    @property
    def damage(self) -> list[CorruptRegion]:
        """What was found wrong by the last `entries`, once it has come to its end."""
        return self._salvage.damage

    @property
    def finished(self) -> bool:
        """Whether the file was closed in good order; known then, too."""
        return self._salvage.finished

    @property
    def world(self) -> WorldConfig | None:
        """What stood there, where that is known: a real robot's settings may name a world, but it is not in it."""
        return self.settings.world if self.info.emulated else None

    def host_s(self, log_ns: int) -> float:
        """Return a log time by the host's clock of the run."""
        return 1e-9 * (log_ns - self.info.unix_minus_host_ns)


def is_recording(path: Path) -> bool:
    """Say whether a file begins like an MCAP file, or is named like one."""
    try:
        with path.open("rb") as file:
            return file.read(len(MAGIC)) == MAGIC or path.suffix == ".mcap"
    except OSError:
        return path.suffix == ".mcap"


def parse_settings(told: dict[str, Any]) -> Settings:
    """Return settings from the form in which a recording holds them.

    Raises
    ------
    pydantic.ValidationError
        They are not those of this version.
    """
    return Settings.model_validate_json(orjson.dumps(told))


@contextlib.contextmanager
def mapped(path: Path) -> Iterator[memoryview]:
    """Give a file's bytes.

    Raises
    ------
    RecordingError
        There is no such file, it cannot be read, or it is empty.
    """
    try:
        with path.open("rb") as file:
            empty = path.stat().st_size == 0
            data = None if empty else mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror or error}; check the path") from error
    if data is None:
        raise RecordingError(f"{path}: is empty; the run ended before anything was written, or the disk was full")
    view = memoryview(data)
    try:
        yield view
    finally:
        with contextlib.suppress(BufferError):  # who was stopped by an error may still hold a piece of it
            view.release()
            data.close()


def refuse_strangers(path: Path, salvage: McapScanner) -> None:
    """Refuse what another program made.

    Raises
    ------
    RecordingError
        Its header names neither our profile nor our library; one damaged byte does not make it another program's.
    """
    named = salvage.profile or salvage.library
    if named and not salvage.profile.startswith(PROFILE) and not salvage.library.startswith(PROFILE):
        raise RecordingError(f"{path}: is an MCAP file of another program ({named!r}), not a recording of a run")


def refuse_newer(path: Path, salvage: McapScanner, told: RunInfo | None = None) -> None:
    """Refuse what this program is too old for; what stands under a checksum goes before what does not.

    Raises
    ------
    RecordingError
        It was written by a newer program.
    """
    form = re.fullmatch(rf"{PROFILE}/(\d+)", salvage.profile)
    of_header = int(form[1]) if form is not None else 0
    of_file = of_header if told is None else told.format
    if of_file > FORMAT:
        raise RecordingError(
            f"{path}: was written by a newer program ({salvage.library}, format {of_file}; this one reads up to "
            f"{FORMAT}): update echolocate"
        )


@contextlib.contextmanager
def open_recording(path: Path) -> Iterator[Recording]:
    """Open a recording, whole or not.

    Raises
    ------
    RecordingError
        It is none, is of a newer program, or holds nothing that can be read; also where what is done with it finds a
        message that is none of this version's.
    """
    with mapped(path) as data:
        salvage = McapScanner(data)
        refuse_strangers(path, salvage)
        info = next((e for chunk in salvage.chunks() for e in chunk if e.topic == RUN_INFO), None)
        if info is None:
            refuse_newer(path, salvage)
            raise RecordingError(f"{path}: {_why_nothing(salvage)}")
        try:
            told = decode(RunInfo, info.data)
            refuse_newer(path, salvage, told)
            settings = parse_settings(told.settings)
        except ValidationError as error:
            raise RecordingError(
                f"{path}: its settings are not those of this version ({_first_of(error)}); replay it with the "
                f"version that made it, or name settings by --with"
            ) from error
        recording = Recording(path, told, settings, data)
        try:
            yield recording
        except ValidationError as error:
            raise RecordingError(
                f"{path}: a message in it has a form that this version does not know ({_first_of(error)}): replay it "
                f"with the version that made it"
            ) from error
        del recording, salvage


def _first_of(error: ValidationError) -> str:
    first = error.errors(include_url=False)[0]
    return f"{'.'.join(map(str, first['loc']))}: {' '.join(first['msg'].split())}"


def _why_nothing(salvage: McapScanner) -> str:
    if not salvage.is_mcap:
        return (
            "is no recording (MCAP), and nothing in it can be read as one; `echolocate run --record FILE` makes one"
        )
    return "holds no message that can be read: it was cut off before the first, or is damaged"
