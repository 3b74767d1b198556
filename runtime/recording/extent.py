"""How long a recording is and whether it is complete, from a few hundred bytes of its file.

A finished file ends with a footer that leads to its statistics. One that is being written, or was cut off, has none:
then the first chunk has the time of its beginning, and the file's own time that of its last write.
"""

from __future__ import annotations

import os
import struct
from pathlib import Path
from typing import BinaryIO, Final, NamedTuple

from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from runtime.recording.mcap_scanner import BEGIN, END_BYTES, RECORD_HEADER

RECORD: Final = struct.Struct("<BQ")
"""Before each record's content: opcode and length."""
FOOTER: Final = struct.Struct("<QQI")
"""Where summary and summary offsets start, and a checksum."""
OFFSET: Final = struct.Struct("<BQQ")
"""Of a group of the summary: opcode, start, length."""
STATISTICS: Final = struct.Struct("<QHIIIIQQ")
"""Counts of messages, schemas, channels, attachments, metadata and chunks; times of first and last message, ns."""
OFFSETS_MAX: Final = 1024
"""Bytes of summary offsets that are looked at; there are five groups at most."""
RECORDS_MAX: Final = 64
"""Records before the first chunk that are passed over; ours have one."""
LENGTH_MAX_S: Final = 1e7
"""A longer one is damaged, s."""


class Extent(NamedTuple):
    """The extent of a recording."""

    duration_s: float | None
    """None where the file does not say."""
    messages: int | None
    """None unless it is complete."""
    is_complete: bool
    """Whether it was closed properly."""


UNKNOWN: Final = Extent(None, None, is_complete=False)


def recording_extent(path: Path) -> Extent:
    """Return how long a recording is; `UNKNOWN` for a file that is none, is empty, or cannot be read."""
    try:
        if not path.is_file():
            return UNKNOWN
        with path.open("rb") as file:
            info = os.fstat(file.fileno())
            complete = _of_statistics(file, info.st_size)
            return complete or _since_first_chunk(file, info.st_mtime)
    except (OSError, struct.error):
        return UNKNOWN


def _of_statistics(file: BinaryIO, size: int) -> Extent | None:
    """Return the extent of a finished file, None of any other."""
    if size < BEGIN + END_BYTES:
        return None
    end = _read(file, size - END_BYTES, END_BYTES)
    opcode, _ = RECORD.unpack_from(end)
    if opcode != Opcode.FOOTER or end[-len(MCAP0_MAGIC) :] != MCAP0_MAGIC:
        return None
    _, offsets_at, _ = FOOTER.unpack_from(end, RECORD_HEADER)
    if not 0 < offsets_at < size - END_BYTES:
        return Extent(None, None, is_complete=True)
    offsets = _read(file, offsets_at, min(OFFSETS_MAX, size - END_BYTES - offsets_at))
    at = 0
    while at + RECORD_HEADER + OFFSET.size <= len(offsets):
        group, start, _ = OFFSET.unpack_from(offsets, at + RECORD_HEADER)
        if group == Opcode.STATISTICS and start < size:
            messages, _, _, _, _, _, first_ns, last_ns = STATISTICS.unpack(
                _read(file, start + RECORD_HEADER, STATISTICS.size)
            )
            return Extent(_seconds(1e-9 * (last_ns - first_ns)), messages, is_complete=True)
        at += RECORD_HEADER + OFFSET.size
    return Extent(None, None, is_complete=True)


def _since_first_chunk(file: BinaryIO, written_unix_s: float) -> Extent:
    """Return the extent of a file without an end."""
    if _read(file, 0, BEGIN) != MCAP0_MAGIC:
        return UNKNOWN
    at = BEGIN
    for _ in range(RECORDS_MAX):
        opcode, length = RECORD.unpack(_read(file, at, RECORD_HEADER))
        if opcode == Opcode.CHUNK:
            (first_ns,) = struct.unpack("<Q", _read(file, at + RECORD_HEADER, 8))
            return Extent(_seconds(written_unix_s - 1e-9 * first_ns), None, is_complete=False)
        at += RECORD_HEADER + length
    return UNKNOWN


def _seconds(duration_s: float) -> float | None:
    return round(duration_s, 1) if 0.0 <= duration_s <= LENGTH_MAX_S else None


def _read(file: BinaryIO, at: int, size: int) -> bytes:
    file.seek(at)
    return file.read(size)
