"""Reading a recording in whatever state it is: cut off anywhere, or with bytes that are not what was written.

A chunk is complete in itself and carries a checksum. What is whole is read; what is not is passed over, told, and the
next chunk is found by its own form. Nothing here raises because of what a file holds.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, DataEnd, Footer, Header, Message, Schema
from mcap.stream_reader import breakup_chunk
from mcap.writer import MCAP0_MAGIC

from runtime.recording.channels import CHANNELS, RawMessage

BEGIN: Final = 8
"""The first byte after the magic ones."""
HEAD: Final = 9
"""Bytes of a record before its content: what it is, how long it is."""
ZSTD: Final = b"\x04\x00\x00\x00zstd"
ZSTD_AT: Final = HEAD + 8 + 8 + 8 + 4
"""Where in a chunk the name of its compression stands."""
CONTENT_MAX: Final = 1 << 30
"""No chunk of ours is a thousandth as large; a damaged length may claim anything."""
HEADER_MAX: Final = 4096
KNOWN: Final = frozenset(int(code) for code in Opcode)
UNREADABLE: Final = (McapError, zstandard.ZstdError, ValueError, struct.error, OverflowError, MemoryError)
"""What reading damaged bytes may end in."""
END_BYTES: Final = HEAD + 20 + len(MCAP0_MAGIC)
"""Footer and magic at the end of a file that was finished."""


@dataclass(frozen=True, slots=True)
class CorruptRegion:
    """Something that is not as it was written: at which byte, and what it costs."""

    at: int
    what: str


class McapScanner:
    """Everything that can be read of a file's bytes.

    Parameters
    ----------
    data : bytes-like
        The whole file; may be mapped.
    """

    def __init__(self, data: memoryview) -> None:
        self._data = data
        self.damage: list[CorruptRegion] = []
        """Known once `chunks` has come to its end."""
        self.finished = False
        """Whether the file was closed in good order; known then, too."""
        self.profile = ""
        self.library = ""
        self.is_mcap = bytes(data[:8]) == MCAP0_MAGIC
        self.chunk_at = BEGIN
        """Where in the file the messages last yielded are found again."""
        self._topics = dict(enumerate(CHANNELS, start=1))
        """By number; those of this program until the file says otherwise."""
        self._schemas: dict[int, Schema] = {}
        self.schemas: dict[str, Schema] = {}
        """By topic, as the file has them."""
        self._read_header()

    def _read_header(self) -> None:
        try:
            code, length = struct.unpack_from("<BQ", self._data, 8)
            if code == Opcode.HEADER:
                header = Header.read(_stream(self._data[8 + HEAD : 8 + HEAD + length]))
                self.profile, self.library = header.profile, header.library
        except UNREADABLE:
            self.profile = ""

    def chunks(self, since: int = BEGIN) -> Iterator[list[RawMessage]]:
        """Yield the messages of every chunk that is whole, in the order of the file.

        Parameters
        ----------
        since : int
            Begin at this byte: one that `chunk_at` named earlier.
        """
        if not self.is_mcap:
            self.damage.append(CorruptRegion(0, "the first bytes are not those of an MCAP file"))
        at, size = since, len(self._data)
        while at < size:
            self.chunk_at = at
            head = self._head(at)
            if head is not None and head[0] == Opcode.DATA_END:
                self._check_end(at, head[1])
                return
            if head is None or self._looks_like_chunk(at):
                entries = None if head is None or head[0] != Opcode.CHUNK else self._chunk(at, head[1])
                if entries is None:
                    entries, at = self._find(at)
                else:
                    at += HEAD + head[1] if head is not None else 0
                if entries is not None:
                    yield entries
            else:
                at += HEAD + head[1]

    def _looks_like_chunk(self, at: int) -> bool:
        """Say whether a chunk begins here, whatever its first byte says."""
        return self._data[at] == Opcode.CHUNK or bytes(self._data[at + ZSTD_AT : at + ZSTD_AT + len(ZSTD)]) == ZSTD

    def _head(self, at: int) -> tuple[int, int] | None:
        """Return what the record at a byte says it is, None where it cannot be one."""
        if at + HEAD > len(self._data):
            return None
        code, length = struct.unpack_from("<BQ", self._data, at)
        if code not in KNOWN or code in {Opcode.FOOTER, Opcode.MESSAGE} or at + HEAD + length > len(self._data):
            return None
        return code, length

    def _find(self, at: int) -> tuple[list[RawMessage] | None, int]:
        """Return the next whole chunk from `at` on, and where to go on after it: the end where there is none."""
        data, look = bytes(self._data[at:]), 0
        while (found := data.find(ZSTD, look)) >= 0:
            look = found + 1
            start = found - ZSTD_AT
            if start < 0 or found + 16 > len(data):
                continue
            (length,) = struct.unpack_from("<Q", data, found + len(ZSTD))
            whole = ZSTD_AT - HEAD + len(ZSTD) + 8 + length
            if start + HEAD + whole <= len(data) and (entries := self._chunk(at + start, whole)) is not None:
                lost = f"{start} bytes cannot be read" if start else "a chunk's kind or length is wrong; it is whole"
                self.damage.append(CorruptRegion(at, lost))
                return entries, at + start + HEAD + whole
        if not self._torn(at):
            self.damage.append(CorruptRegion(at, f"nothing can be read from here to the end, {len(data)} bytes"))
        return None, len(self._data)

    def _torn(self, at: int) -> bool:
        """Say whether the file just ends here, in the middle of a record: that is a cut and no damage."""
        if at + HEAD > len(self._data):
            return True
        code, length = struct.unpack_from("<BQ", self._data, at)
        longest = {Opcode.CHUNK: CONTENT_MAX, Opcode.HEADER: HEADER_MAX, Opcode.DATA_END: 4}.get(code, 0)
        return bool(length <= longest) and at + HEAD + length > len(self._data)

    def _chunk(self, at: int, length: int) -> list[RawMessage] | None:
        """Return the messages of the chunk at a byte, None where it is damaged."""
        try:
            chunk = Chunk.read(_stream(self._data[at + HEAD : at + HEAD + length]))
            if len(chunk.data) + len(ZSTD) + 8 + ZSTD_AT - HEAD != length:
                return None
            if chunk.compression != "zstd" or not 0 < chunk.uncompressed_size < CONTENT_MAX:
                return None
            if zstandard.frame_content_size(chunk.data) != chunk.uncompressed_size:
                return None
            records = breakup_chunk(chunk, validate_crc=True)
        except UNREADABLE:
            return None
        if not chunk.uncompressed_crc:
            return None
        entries = []
        for record in records:
            if isinstance(record, Schema):
                self._schemas[record.id] = record
            elif isinstance(record, Channel):
                self._topics[record.id] = record.topic
                if record.schema_id in self._schemas:
                    self.schemas[record.topic] = self._schemas[record.schema_id]
            elif isinstance(record, Message) and record.channel_id in self._topics:
                entries.append(RawMessage(self._topics[record.channel_id], record.log_time, record.data))
        times = [entry.log_ns for entry in entries]
        if times and (min(times), max(times)) != (chunk.message_start_time, chunk.message_end_time):
            self.damage.append(CorruptRegion(at, "a chunk's own times are wrong; its messages are whole"))
        return entries

    def _check_end(self, at: int, length: int) -> None:
        """Check what follows the messages: checksums of all before it and of the index."""
        self.finished = True
        try:
            end = DataEnd.read(_stream(self._data[at + HEAD : at + HEAD + length]))
            summary = at + HEAD + length
            footer_at = len(self._data) - END_BYTES
            footer = Footer.read(_stream(self._data[footer_at + HEAD :]))
            head = struct.unpack_from("<BQ", self._data, footer_at)
            index = zlib.crc32(self._data[summary : footer_at + HEAD + 16])
            whole = bytes(self._data[-8:]) == MCAP0_MAGIC and head == (Opcode.FOOTER, 20)
        except UNREADABLE:
            self.finished = False
            return
        if not whole:
            self.damage.append(CorruptRegion(at, "the end of the file is damaged or missing; its messages are whole"))
            self.finished = False
        elif index != footer.summary_crc:
            self.damage.append(CorruptRegion(summary, "the index is damaged; the messages are whole"))
        if end.data_section_crc != zlib.crc32(self._data[:at]) and not self.damage:
            self.damage.append(CorruptRegion(0, "a byte between the chunks is damaged; their messages are whole"))


def _stream(data: memoryview) -> ReadDataStream:
    return ReadDataStream(io.BytesIO(data))
