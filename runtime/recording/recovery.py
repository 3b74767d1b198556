"""Copying the whole chunks of a damaged or unfinished recording into a file that is closed properly."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Final

from mcap.writer import CompressionType, Writer

from runtime.recording.channels import CHANNELS, CYCLE, RawMessage, schema_of
from runtime.recording.mcap_file import CHUNK_BYTES, PROFILE
from runtime.recording.mcap_scanner import CorruptRegion, McapScanner
from runtime.recording.reader import RecordingError, check_format, check_origin, map_file
from runtime.recording.schema import FORMAT

PARTIAL: Final = ".part"
"""Suffix of the file until it is complete, after the number of the process."""


@dataclass(frozen=True, slots=True)
class Recovered:
    """What was recovered."""

    path: Path
    chunks: int
    messages: int
    cycles: int
    first_ns: int
    """Log time of the first message, Unix time in ns."""
    last_ns: int
    corrupt_regions: tuple[CorruptRegion, ...]
    finished: bool
    """Whether the original had been closed properly."""


def recover(source: Path, target: Path) -> Recovered:
    """Copy every whole chunk of `source` to `target` and return what was recovered.

    Raises
    ------
    RecordingError
        The source is not a recording, or nothing in it can be read.
    OSError
        The target cannot be written; it does not exist then.
    """
    partial = target.with_name(f"{target.name}.{os.getpid()}{PARTIAL}")
    with map_file(source) as data:
        scanner = McapScanner(data)
        check_origin(source, scanner)
        # Exclusively: a file of any name may be the user's, or even the source.
        file = partial.open("xb")
        try:
            with file:
                recovered = _copy(scanner, source, file, target)
            partial.replace(target)
        finally:
            partial.unlink(missing_ok=True)
            del scanner
    return recovered


def _copy(scanner: McapScanner, source: Path, file: BinaryIO, target: Path) -> Recovered:
    """Copy whatever is readable into a new file and return what that was; `target` is only named.

    Raises
    ------
    RecordingError
        Nothing is.
    OSError
        The file cannot be written.
    """
    chunks = messages = cycles = 0
    first_ns = last_ns = 0
    writer = Writer(file, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD, enable_data_crcs=True)
    writer.start(profile=scanner.profile or f"{PROFILE}/{FORMAT}", library=scanner.library or PROFILE)
    channels: dict[str, int] = {}
    for chunk in scanner.chunks():
        for message in chunk:
            if message.topic not in channels:
                channels[message.topic] = _register(writer, scanner, message)
            writer.add_message(channels[message.topic], message.log_ns, message.data, message.log_ns)
            first_ns = message.log_ns if not messages else min(first_ns, message.log_ns)
            last_ns = max(last_ns, message.log_ns)
            messages += 1
            cycles += message.topic == CYCLE
        chunks += 1
        writer.flush()
    if not messages:
        check_format(source, scanner)
        raise RecordingError(f"{source}: holds no whole chunk: nothing can be recovered")
    writer.finish()
    file.flush()
    os.fsync(file.fileno())
    return Recovered(
        target, chunks, messages, cycles, first_ns, last_ns, tuple(scanner.corrupt_regions), scanner.finished
    )


def _register(writer: Writer, scanner: McapScanner, message: RawMessage) -> int:
    """Register a channel, with the file's own schema if it has one, and return its number."""
    schema = scanner.schemas.get(message.topic)
    if schema is not None:
        number = writer.register_schema(schema.name, schema.encoding, schema.data)
    elif message.topic in CHANNELS:
        kind = CHANNELS[message.topic]
        number = writer.register_schema(kind.__name__, "jsonschema", schema_of(kind))
    else:
        number = 0
    return writer.register_channel(message.topic, "json", number)
