"""A damaged or unfinished recording written anew: every whole chunk, with an index, as if it had been closed."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from mcap.writer import CompressionType, Writer

from runtime.recording.channels import CHANNELS, CYCLE, RawMessage, schema_of
from runtime.recording.mcap_file import CHUNK_BYTES, INDEX, PROFILE
from runtime.recording.mcap_scanner import CorruptRegion, McapScanner
from runtime.recording.reader import RecordingError, mapped, refuse_newer, refuse_strangers

BESIDE: Final = ".part"
"""Added to the name of a file under way, which takes its name only once it is whole."""


@dataclass(frozen=True, slots=True)
class Recovered:
    """What was restored."""

    path: Path
    chunks: int
    messages: int
    cycles: int
    first_ns: int
    last_ns: int
    damage: tuple[CorruptRegion, ...]
    finished: bool
    """Whether the original had been closed in good order."""


def recover(source: Path, target: Path) -> Recovered:
    """Write every whole chunk of `source` to `target`.

    Raises
    ------
    RecordingError
        The source is no recording, or nothing in it can be read.
    OSError
        The target cannot be written; then there is none.
    """
    beside = target.with_name(target.name + BESIDE)
    with mapped(source) as data:
        salvage = McapScanner(data)
        refuse_strangers(source, salvage)
        try:
            recovered = _copy(salvage, source, beside, target)
            beside.replace(target)
        finally:
            beside.unlink(missing_ok=True)
            del salvage
    return recovered


def _copy(salvage: McapScanner, source: Path, beside: Path, target: Path) -> Recovered:
    chunks = messages = cycles = 0
    first_ns = last_ns = 0
    with beside.open("wb") as file:
        writer = Writer(file, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD, index_types=INDEX,
                        enable_data_crcs=True)  # fmt: skip
        writer.start(profile=salvage.profile or f"{PROFILE}/1", library=salvage.library or PROFILE)
        numbers: dict[str, int] = {}
        for entries in salvage.chunks():
            for entry in entries:
                if entry.topic not in numbers:
                    numbers[entry.topic] = _channel(writer, salvage, entry)
                writer.add_message(numbers[entry.topic], entry.log_ns, entry.data, entry.log_ns)
                first_ns = entry.log_ns if not messages else min(first_ns, entry.log_ns)
                last_ns = max(last_ns, entry.log_ns)
                messages += 1
                cycles += entry.topic == CYCLE
            chunks += 1
            writer.flush()
        if not messages:
            refuse_newer(source, salvage)
            raise RecordingError(f"{source}: holds no chunk that is whole: nothing can be restored")
        writer.finish()
        file.flush()
        os.fsync(file.fileno())
    return Recovered(target, chunks, messages, cycles, first_ns, last_ns, tuple(salvage.damage), salvage.finished)


def _channel(writer: Writer, salvage: McapScanner, entry: RawMessage) -> int:
    """Register a channel with the schema that the file has for it, or else this program's."""
    schema = salvage.schemas.get(entry.topic)
    if schema is not None:
        number = writer.register_schema(schema.name, schema.encoding, schema.data)
    elif entry.topic in CHANNELS:
        form = CHANNELS[entry.topic]
        number = writer.register_schema(form.__name__, "jsonschema", schema_of(form))
    else:
        number = 0
    return writer.register_channel(entry.topic, "json", number)
