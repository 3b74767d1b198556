"""Reading a recording in any state: cut off anywhere, or with damaged bytes.

A chunk is complete in itself and has a checksum. Whole chunks are read; anything else is skipped and reported, and
the next chunk is found by the byte pattern at its start. No content of a file raises an exception here.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, NamedTuple

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, DataEnd, Footer, Header, Schema
from mcap.writer import MCAP0_MAGIC

from runtime.recording.channels import CHANNELS, RawMessage

BEGIN: Final = 8
"""Offset of the first record, after the magic bytes."""
RECORD_HEADER: Final = 9
"""Bytes of a record before its content: opcode (1) and length (8)."""
ZSTD: Final = b"\x04\x00\x00\x00zstd"
ZSTD_AT: Final = RECORD_HEADER + 8 + 8 + 8 + 4
"""Offset of the compression's name in a chunk record."""
CHUNK_HEAD: Final = ZSTD_AT - RECORD_HEADER + len(ZSTD) + 8
"""Bytes of a chunk's content before its data: times, size, checksum, compression, size of the data."""
CONTENT_MAX: Final = 64 << 20
"""Largest chunk that is decompressed, bytes. Ours have 256 KiB, or one keyframe of up to a few MiB."""
RECORDS_MAX: Final = 1 << 16
"""Most records in a chunk that is read; each takes half a kilobyte. Ours have up to a few thousand."""
CHUNK_MAX: Final = CONTENT_MAX + (1 << 20)
"""Longest chunk record: what does not shrink by compression grows by little."""
MESSAGE_HEAD: Final = struct.Struct("<HIQQ")
"""Of a message record: channel, sequence number, log time and publish time."""
INDEX_HEAD: Final = struct.Struct("<HI")
"""Of an index of a chunk's messages: channel and size of the list that follows."""
INDEX_MAX: Final = INDEX_HEAD.size + 16 * RECORDS_MAX
DATA_END_BYTES: Final = 4
FRAME_HEAD_MAX: Final = 18
"""Longest head of a Zstandard frame, bytes."""
BLOCK_HEAD: Final = 3
"""Bytes before each of its blocks."""
CHECKSUM_BYTES: Final = 4
"""Length of its checksum."""
REPEATED: Final = 1
"""Kind of a block that repeats one byte."""
HEADER_MAX: Final = 4096
SEARCH_BYTES: Final = 1 << 20
"""What is searched at a time for the next chunk: a file may be larger than the memory, and most of it a hole."""
TOPIC_MAX: Final = 256
"""Longest topic that is kept, characters."""
SCHEMA_MAX: Final = 1 << 20
"""Largest schema that is kept, bytes; ours have some ten thousand."""
SCHEMAS_MAX: Final = 64
OPCODES: Final = frozenset(int(code) for code in Opcode)
UNREADABLE: Final = (McapError, zstandard.ZstdError, ValueError, struct.error, OverflowError, MemoryError)
"""Exceptions that reading damaged bytes may raise."""
END_BYTES: Final = RECORD_HEADER + 20 + len(MCAP0_MAGIC)
"""Size of footer and magic at the end of a finished file."""


@dataclass(frozen=True, slots=True)
class CorruptRegion:
    """A region of a file that differs from what was written."""

    offset: int
    """Byte in the file."""
    description: str

    def __str__(self) -> str:
        return f"at byte {self.offset}: {self.description}"


def frame_bytes(data: memoryview, at: int) -> int:
    """Return the length of the Zstandard frame at a byte, by the heads of its blocks (RFC 8878); 0 without an end."""
    try:
        head = bytes(data[at : at + FRAME_HEAD_MAX])
        end, is_last = at + zstandard.frame_header_size(head), False
        while not is_last:
            block = int.from_bytes(data[end : end + BLOCK_HEAD], "little")
            is_last, kind, size = block & 1 == 1, block >> 1 & 3, block >> 3
            end += BLOCK_HEAD + (1 if kind == REPEATED else size)
            if end > len(data):
                return 0
        return end - at + (CHECKSUM_BYTES if zstandard.get_frame_parameters(head).has_checksum else 0)
    except UNREADABLE:
        return 0


class McapScanner:
    """Reader of everything readable in a file's bytes.

    Parameters
    ----------
    data : memoryview
        The whole file; may be memory-mapped.
    """

    def __init__(self, data: memoryview) -> None:
        self._data = data
        self.corrupt_regions: list[CorruptRegion] = []
        """What is damaged; complete once `chunks` is exhausted."""
        self.finished = False
        """Whether the file was closed properly; known once `chunks` is exhausted."""
        self.profile = ""
        self.library = ""
        """From the file's header; empty if that is unreadable."""
        self.is_mcap = bytes(data[:8]) == MCAP0_MAGIC
        """Whether the file starts with MCAP's magic bytes."""
        self.chunk_offset = BEGIN
        """Where the messages last yielded by `chunks` start in the file."""
        # This program's own channel numbers apply until the file defines others.
        self._topics = dict(enumerate(CHANNELS, start=1))
        self._schemas: dict[int, Schema] = {}
        self.schemas: dict[str, Schema] = {}
        """The schemas in the file, by topic."""
        self._read_header()

    def _read_header(self) -> None:
        """Read profile and library, if the header is whole."""
        try:
            code, length = struct.unpack_from("<BQ", self._data, 8)
            if code == Opcode.HEADER:
                content = self._data[8 + RECORD_HEADER : 8 + RECORD_HEADER + min(length, HEADER_MAX)]
                header = Header.read(_stream(content))
                self.profile, self.library = header.profile, header.library
        except UNREADABLE:
            self.profile = ""

    def chunks(self, since: int = BEGIN) -> Iterator[list[RawMessage]]:
        """Yield the messages of every whole chunk, in file order.

        `since` is the byte to start at, a value that `chunk_offset` had before.
        """
        if not self.is_mcap:
            self._note(0, "the first bytes are not those of an MCAP file")
        at, size = since, len(self._data)
        while at < size:
            self.chunk_offset = at
            head = self._record_at(at)
            if head is not None and head[0] == Opcode.DATA_END:
                self._check_end(at, head[1])
                return
            if head is None or self._looks_like_chunk(at):
                messages = None if head is None or head[0] != Opcode.CHUNK else self._chunk(at, head[1])
                if messages is None:
                    messages, at = self._find_chunk(at)
                else:
                    at += RECORD_HEADER + head[1] if head is not None else 0
                if messages is not None:
                    yield messages
            else:
                at += RECORD_HEADER + head[1]

    def _note(self, offset: int, description: str) -> None:
        self.corrupt_regions.append(CorruptRegion(offset, description))

    def _looks_like_chunk(self, at: int) -> bool:
        """Return whether a chunk starts here, even if its opcode is damaged."""
        return self._data[at] == Opcode.CHUNK or bytes(self._data[at + ZSTD_AT : at + ZSTD_AT + len(ZSTD)]) == ZSTD

    def _record_at(self, at: int) -> tuple[int, int] | None:
        """Return opcode and length of the record at a byte; None if there cannot be one."""
        if at + RECORD_HEADER > len(self._data):
            return None
        code, length = struct.unpack_from("<BQ", self._data, at)
        if code not in OPCODES or code in {Opcode.FOOTER, Opcode.MESSAGE}:
            return None
        if at + RECORD_HEADER + length > len(self._data):
            return None
        # One wrong bit of these, which stand between the chunks, would skip chunks that are whole.
        if code == Opcode.MESSAGE_INDEX and not self._is_index(at + RECORD_HEADER, length):
            return None
        return None if code == Opcode.DATA_END and length != DATA_END_BYTES else (code, length)

    def _is_index(self, at: int, length: int) -> bool:
        """Return whether the length of an index of messages agrees with that of the list in it."""
        if length < INDEX_HEAD.size:
            return False
        _, list_bytes = INDEX_HEAD.unpack_from(self._data, at)
        return bool(length == INDEX_HEAD.size + list_bytes)

    def _find_chunk(self, at: int) -> tuple[list[RawMessage] | None, int]:
        """Return the next whole chunk from `at` on and the byte after it; without one, None and the file's end.

        What is skipped is noted as corrupt.
        """
        size = len(self._data)
        for found in self._marks(at):
            start = found - ZSTD_AT
            if start < at or found + 16 > size:
                continue
            # Not by the lengths in its head: where one of them is wrong, the chunks that follow would be skipped.
            whole = CHUNK_HEAD + frame_bytes(self._data, start + RECORD_HEADER + CHUNK_HEAD)
            if start + RECORD_HEADER + whole <= size and (chunk := self._chunk(start, whole)) is not None:
                wrong_head = "a chunk's kind or length is wrong; its messages are whole"
                self._note(at, f"{start - at} bytes cannot be read" if start > at else wrong_head)
                return chunk, start + RECORD_HEADER + whole
        if not self._is_cut_off(at):
            self._note(at, f"nothing can be read from here to the end, {size - at} bytes")
        return None, size

    def _marks(self, since: int) -> Iterator[int]:
        """Yield every place of a chunk's compression from a byte on."""
        for begin in range(since, len(self._data), SEARCH_BYTES):
            block = bytes(self._data[begin : begin + SEARCH_BYTES + len(ZSTD) - 1])
            at = block.find(ZSTD)
            while at >= 0:
                yield begin + at
                at = block.find(ZSTD, at + 1)

    def _is_cut_off(self, at: int) -> bool:
        """Return whether the file just ends in the middle of this record, which does not count as corrupt."""
        if at + RECORD_HEADER > len(self._data):
            return True
        code, length = struct.unpack_from("<BQ", self._data, at)
        longest = {
            Opcode.CHUNK: CONTENT_MAX,
            Opcode.MESSAGE_INDEX: INDEX_MAX,
            Opcode.HEADER: HEADER_MAX,
            Opcode.DATA_END: DATA_END_BYTES,
        }.get(code, 0)
        return bool(length <= longest) and at + RECORD_HEADER + length > len(self._data)

    def _chunk(self, at: int, length: int) -> list[RawMessage] | None:
        """Return the messages of the chunk at a byte; None if it is damaged."""
        if not CHUNK_HEAD <= length <= CHUNK_MAX:
            return None
        try:
            begin_ns, end_ns, size, crc = struct.unpack_from("<QQQI", self._data, at + RECORD_HEADER)
            compression = bytes(self._data[at + ZSTD_AT : at + ZSTD_AT + len(ZSTD)])
            if compression != ZSTD or not 0 < size < CONTENT_MAX or not crc:
                return None
            if CHUNK_HEAD + frame_bytes(self._data, at + RECORD_HEADER + CHUNK_HEAD) != length:
                return None
            # Not copied: a file of many chunks, each as long as the rest of it, would take forever.
            data = self._data[at + RECORD_HEADER + CHUNK_HEAD : at + RECORD_HEADER + length]
            if zstandard.frame_content_size(data) != size:
                return None
            content = zstandard.decompress(data)
            if zlib.crc32(content) != crc:
                return None
            records = list(_records(content))
        except UNREADABLE:
            return None
        messages = []
        for record in records:
            if isinstance(record, Schema):
                self._keep_schema(record)
            elif isinstance(record, Channel):
                self._keep_channel(record)
            elif record.channel in self._topics:
                messages.append(RawMessage(self._topics[record.channel], record.log_ns, record.data))
        times = [message.log_ns for message in messages]
        if times and (min(times), max(times)) != (begin_ns, end_ns):
            self._note(at, "a chunk's own times are wrong; its messages are whole")
        return messages

    def _keep_schema(self, schema: Schema) -> None:
        """Keep a schema, but no more than a recording can have: a small file may expand to many large ones."""
        size = len(schema.data) + len(schema.name) + len(schema.encoding)
        if size <= SCHEMA_MAX and (schema.id in self._schemas or len(self._schemas) < SCHEMAS_MAX):
            self._schemas[schema.id] = schema

    def _keep_channel(self, channel: Channel) -> None:
        """Keep a channel's topic and schema, within the same limits."""
        if len(channel.topic) <= TOPIC_MAX:
            self._topics[channel.id] = channel.topic
            if channel.schema_id in self._schemas and (
                channel.topic in self.schemas or len(self.schemas) < SCHEMAS_MAX
            ):
                self.schemas[channel.topic] = self._schemas[channel.schema_id]

    def _check_end(self, at: int, length: int) -> None:
        """Check what follows the messages: the checksums of everything before it and of the index."""
        self.finished = True
        try:
            end = DataEnd.read(_stream(self._data[at + RECORD_HEADER : at + RECORD_HEADER + min(length, END_BYTES)]))
            summary = at + RECORD_HEADER + length
            footer_at = len(self._data) - END_BYTES
            footer = Footer.read(_stream(self._data[footer_at + RECORD_HEADER :]))
            head = struct.unpack_from("<BQ", self._data, footer_at)
            index = zlib.crc32(self._data[summary : footer_at + RECORD_HEADER + 16])
            is_whole = bytes(self._data[-8:]) == MCAP0_MAGIC and head == (Opcode.FOOTER, 20)
        except UNREADABLE:
            self.finished = False
            return
        if not is_whole:
            self._note(at, "the end of the file is damaged or missing; its messages are whole")
            self.finished = False
        elif index != footer.summary_crc:
            self._note(summary, "the index is damaged; the messages are whole")
        if end.data_section_crc != zlib.crc32(self._data[:at]) and not self.corrupt_regions:
            self._note(0, "a byte between the chunks is damaged; their messages are whole")


class _Message(NamedTuple):
    """A message record of a chunk."""

    channel: int
    log_ns: int
    data: bytes


def _records(content: bytes) -> Iterator[Schema | Channel | _Message]:
    """Yield the records of a chunk's content; each is read within its own length.

    Raises
    ------
    ValueError
        A record leads out of the chunk, or there are more than `RECORDS_MAX`.
    McapError
        A schema or channel is longer than its record.
    struct.error
        A record is too short for its kind.
    """
    at = 0
    for _ in range(RECORDS_MAX):
        if at == len(content):
            return
        code, length = struct.unpack_from("<BQ", content, at)
        begin, at = at + RECORD_HEADER, at + RECORD_HEADER + length
        if at > len(content):
            raise ValueError("a record leads out of its chunk")
        if code == Opcode.MESSAGE:
            channel, _sequence, log_ns, _published_ns = MESSAGE_HEAD.unpack_from(content, begin)
            yield _Message(channel, log_ns, content[begin + MESSAGE_HEAD.size : at])
        elif code == Opcode.SCHEMA:
            yield Schema.read(_stream(memoryview(content)[begin:at]))
        elif code == Opcode.CHANNEL:
            yield Channel.read(_stream(memoryview(content)[begin:at]))
    if at != len(content):
        raise ValueError(f"more than {RECORDS_MAX} records")


def _stream(data: memoryview) -> ReadDataStream:
    return ReadDataStream(io.BytesIO(data))
