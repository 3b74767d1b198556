"""One file of a recording while it is written: small chunks, each complete in itself once it is flushed."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path
from typing import Final

from mcap.writer import CompressionType, IndexType, Writer

from runtime import VERSION
from runtime.recording.channels import CHANNELS, RUN_INFO, schema_of
from runtime.recording.schema import FORMAT

PROFILE: Final = "echolocate"
CHUNK_BYTES: Final = 256 * 1024
"""A chunk ends at this size, or when it is flushed: whatever is damaged costs no more than this."""

INDEX: Final = IndexType.CHUNK | IndexType.ATTACHMENT | IndexType.METADATA
"""No index of single messages: in chunks as small as these it would be a third of the file."""


class McapFile:
    """An MCAP file under way.

    Parameters
    ----------
    path : Path
        Replaced if it exists.
    info : bytes
        The first message, in a chunk of its own with schemas and channels.
    log_ns : int
        Its log time.

    Raises
    ------
    OSError
        As every method does, where the disk will not have it.
    """

    def __init__(self, path: Path, info: bytes, log_ns: int) -> None:
        self.path = path
        self._file = path.open("wb")
        self._writer = Writer(
            self._file, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD, index_types=INDEX,
            enable_crcs=True, enable_data_crcs=True,
        )  # fmt: skip
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        try:
            self._begin(info, log_ns)
        except OSError:
            self.abandon()
            raise

    def _begin(self, info: bytes, log_ns: int) -> None:
        self._writer.start(profile=f"{PROFILE}/{FORMAT}", library=f"echolocate {VERSION}")
        for topic, form in CHANNELS.items():
            self.channel(topic, form.__name__, schema_of(form))
        self.add(RUN_INFO, info, log_ns)
        self.flush()

    def channel(self, topic: str, name: str, schema: bytes) -> None:
        """Register a channel of JSON messages."""
        if name not in self._schemas:
            self._schemas[name] = self._writer.register_schema(name, "jsonschema", schema)
        self._channels[topic] = self._writer.register_channel(topic, "json", self._schemas[name])

    def add(self, topic: str, data: bytes, log_ns: int, sequence: int = 0) -> None:
        """Add a message to the chunk under way."""
        self._writer.add_message(self._channels[topic], log_ns, data, log_ns, sequence)

    @property
    def bytes(self) -> int:
        """Size of the file so far."""
        return self._file.tell()

    def flush(self) -> None:
        """End the chunk under way and hand it to the system: from here on it survives the death of this process."""
        self._writer.flush()

    def sync(self) -> None:
        """Wait until the disk has it: from here on it survives a power cut."""
        os.fsync(self._file.fileno())

    def finish(self) -> None:
        """Write the index and close the file."""
        try:
            self._writer.finish()
            self._file.flush()
            self.sync()
        finally:
            self.abandon()

    def abandon(self) -> None:
        """Close the file as it is; every chunk that was flushed can be read."""
        with contextlib.suppress(OSError):
            self._file.close()
