"""An open recording: the description of the run, and its messages, also if the file is damaged or cut off."""

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

from config.bounded import TIME_MAX_S
from config.errors import WRONG_CALL, UserError
from config.settings import Settings
from config.world import WorldConfig
from runtime.cycle.step import CycleRecord
from runtime.recording.channels import CYCLE, RUN_INFO, RawMessage, decode
from runtime.recording.mcap_file import PROFILE
from runtime.recording.mcap_scanner import CorruptRegion, McapScanner
from runtime.recording.schema import FORMAT, Cycle, RunInfo

MAGIC: Final = b"\x89MCAP"
CYCLE_HEAD: Final = re.compile(rb'\{"record":\{"cycle":(\d{1,15}),"inputs":\{"run_s":([0-9.eE+-]{1,25}),')
"""The start of a cycle's message: its number and its time."""


class RecordingError(UserError):
    """A recording cannot be read."""

    exit_code = WRONG_CALL


@dataclass
class Recording:
    """An open recording."""

    path: Path
    """The file."""
    info: RunInfo
    """Description of the run."""
    settings: Settings
    """The run's settings at the start of the file."""
    _data: memoryview
    _scanner: McapScanner = field(init=False)

    def __post_init__(self) -> None:
        self._scanner = McapScanner(self._data)
        self._sensors = len(self.settings.ring.mounts)

    def messages(self) -> Iterator[RawMessage]:
        """Yield every readable message in file order; may be called again."""
        for _, chunk in self.chunks():
            yield from chunk

    def chunks(self, since: int | None = None) -> Iterator[tuple[int, list[RawMessage]]]:
        """Yield each chunk's offset in the file and its messages.

        `since` is the offset of the chunk to start at; then the whole file must have been read once before.
        """
        scanner = self._scanner
        if since is None:
            scanner.corrupt_regions, scanner.finished = [], False
            for chunk in scanner.chunks():
                yield scanner.chunk_offset, chunk
            return
        regions = list(scanner.corrupt_regions)
        try:
            for chunk in scanner.chunks(since):
                yield scanner.chunk_offset, chunk
        finally:
            scanner.corrupt_regions = regions  # a second pass over a part finds some of them again

    def cycle_records(self) -> Iterator[CycleRecord]:
        """Yield the record of every readable cycle in file order.

        Raises
        ------
        RecordingError
            A firing is of another ring.
        """
        return (self.decode_cycle(message) for message in self.messages() if message.topic == CYCLE)

    def decode_cycle(self, message: RawMessage) -> CycleRecord:
        """Return the record in a cycle's message.

        Raises
        ------
        RecordingError
            A firing is of another ring: compiled code would read beyond its arrays.
        """
        record = decode(Cycle, message.data).record
        sensors = self._sensors
        for firing in record.inputs.received.firings:
            if len(firing.ranges_m) != sensors:
                raise RecordingError(
                    f"{self.path}: cycle {record.cycle} has a firing of {len(firing.ranges_m)} ranges, but the ring "
                    f"has {sensors} sensors: the recording is damaged, or was changed"
                )
        return record

    @property
    def corrupt_regions(self) -> list[CorruptRegion]:
        """The corrupt regions found by the last full pass over the messages; complete once that is exhausted."""
        return self._scanner.corrupt_regions

    @property
    def finished(self) -> bool:
        """Whether the file was closed properly; known after a full pass over the messages."""
        return self._scanner.finished

    @property
    def world(self) -> WorldConfig | None:
        """The true world of an emulated run. None for a real robot: its settings may name a world it is not in."""
        return self.settings.world if self.info.emulated else None


def cycle_head(message: RawMessage) -> tuple[int, float]:
    """Return number and time (run's clock, s) of a cycle's message without decoding all of it, which takes long."""
    found = CYCLE_HEAD.match(message.data)
    if found is not None:
        with contextlib.suppress(ValueError):  # such a number as "1e-e+" is left to the decoder
            run_s = float(found[2])
            if abs(run_s) <= TIME_MAX_S:
                return int(found[1]), run_s
    record = decode(Cycle, message.data).record
    return record.cycle, record.inputs.run_s


def is_recording(path: Path) -> bool:
    """Return whether a file starts like an MCAP file or is named like one; a pipe is not read."""
    with contextlib.suppress(OSError, ValueError):
        if path.is_file():
            with path.open("rb") as file:
                return file.read(len(MAGIC)) == MAGIC or path.suffix == ".mcap"
    return path.suffix == ".mcap"


def parse_settings(data: dict[str, Any]) -> Settings:
    """Return settings from their form in a recording.

    Raises
    ------
    pydantic.ValidationError
        They are not valid in this version.
    """
    return Settings.model_validate_json(orjson.dumps(data))


@contextlib.contextmanager
def map_file(path: Path) -> Iterator[memoryview]:
    """Memory-map a file and yield its bytes.

    Raises
    ------
    RecordingError
        The file does not exist, cannot be read, is empty, or is a pipe.
    """
    try:
        if path.is_fifo() or path.is_char_device():
            raise RecordingError(f"{path}: is a pipe or a device; a recording is read from a file")
        with path.open("rb") as file:
            is_empty = path.stat().st_size == 0
            data = None if is_empty else mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror or error}; check the path") from error
    if data is None:
        raise RecordingError(f"{path}: is empty; the run ended before anything was written, or the disk was full")
    view = memoryview(data)
    try:
        yield view
    finally:
        with contextlib.suppress(BufferError):  # after an exception its traceback may still refer to a slice
            view.release()
            data.close()


def check_origin(path: Path, scanner: McapScanner) -> None:
    """Refuse a file that another program wrote.

    Raises
    ------
    RecordingError
        Neither profile nor library in its header is ours; one damaged byte therefore does not refuse our own files.
    """
    name = scanner.profile or scanner.library
    if name and not scanner.profile.startswith(PROFILE) and not scanner.library.startswith(PROFILE):
        raise RecordingError(f"{path}: is an MCAP file of another program ({name!r}), not a recording of a run")


def check_format(path: Path, scanner: McapScanner, info: RunInfo | None = None) -> None:
    """Refuse a recording of another format version.

    Parameters
    ----------
    path : Path
        The file, for the message.
    scanner : McapScanner
        Of the file.
    info : RunInfo, optional
        The file's first message. Its version counts more than the header's, which no checksum protects.

    Raises
    ------
    RecordingError
        The version is known and is not ours.
    """
    header = re.fullmatch(rf"{PROFILE}/(\d+)", scanner.profile)
    version = info.format if info is not None else FORMAT if header is None else int(header[1])
    if version != FORMAT:
        raise RecordingError(
            f"{path}: has recording format {version} (written by {scanner.library}), and this program reads "
            f"format {FORMAT} only: use {'a newer' if version > FORMAT else 'the older'} echolocate"
        )


@contextlib.contextmanager
def open_recording(path: Path) -> Iterator[Recording]:
    """Open a recording, damaged or not.

    Raises
    ------
    RecordingError
        The file is not a recording, has another format version, or nothing in it can be read. Also raised if the body
        of the `with` statement decodes a message that is invalid in this version.
    """
    with map_file(path) as data:
        scanner = McapScanner(data)
        check_origin(path, scanner)
        first = next((m for chunk in scanner.chunks() for m in chunk if m.topic == RUN_INFO), None)
        if first is None:
            check_format(path, scanner)
            raise RecordingError(f"{path}: {_why_unreadable(scanner)}")
        try:
            info = decode(RunInfo, first.data)
            check_format(path, scanner, info)
            settings = parse_settings(info.settings)
        except ValidationError as error:
            raise RecordingError(
                f"{path}: its settings are not valid in this version ({first_error(error)}); replay it with the "
                f"version that wrote it, or give other settings by --with"
            ) from error
        recording = Recording(path, info, settings, data)
        try:
            yield recording
        except ValidationError as error:
            raise RecordingError(
                f"{path}: a message in it is not valid in this version ({first_error(error)}): replay it with the "
                f"version that wrote it"
            ) from error
        del recording, scanner


def first_error(error: ValidationError) -> str:
    """Return in one line what is wrong first with a message."""
    first = error.errors(include_url=False, include_input=False)[0]
    return f"{'.'.join(map(str, first['loc']))}: {' '.join(first['msg'].split())}"


def _why_unreadable(scanner: McapScanner) -> str:
    if not scanner.is_mcap:
        return "is not a recording (MCAP), and nothing in it can be read; `echolocate run --record FILE` makes one"
    return "holds no readable message: it was cut off before the first one, or is damaged"
