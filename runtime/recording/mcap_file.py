"""An MCAP file while it is being written: small chunks, each readable by itself once it is flushed.

After each chunk comes an index of its messages, without which npm's `@mcap/core`, and so Foxglove, reads no message.
It is locked while it is open: other runs then leave it alone when they make room.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
from pathlib import Path
from typing import Final

from mcap.writer import CompressionType, Writer

from runtime import VERSION
from runtime.recording.channels import CHANNELS, RUN_INFO, schema_of
from runtime.recording.schema import FORMAT

PROFILE: Final = "echolocate"
CHUNK_BYTES: Final = 256 * 1024
"""Largest chunk, bytes: a corrupt byte costs no more than one chunk."""


class McapFile:
    """An open MCAP file. Every method raises OSError if the disk fails.

    Parameters
    ----------
    path : Path
        Replaced if it exists.
    info : bytes
        The first message, written in a chunk of its own with schemas and channels.
    log_ns : int
        Its log time, Unix time in ns.

    Raises
    ------
    OSError
        The file cannot be created or written.
    """

    def __init__(self, path: Path, info: bytes, log_ns: int) -> None:
        self.path = path
        self._file = path.open("wb")
        with contextlib.suppress(
            OSError
        ):  # a file that the user named is locked already, see `run`; or no locks exist
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        self._writer = Writer(
            self._file, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD, enable_data_crcs=True
        )
        self._channels: dict[str, int] = {}
        """Numbers by topic."""
        self._schemas: dict[str, int] = {}
        """Numbers by name."""
        try:
            self._begin(info, log_ns)
        except OSError:
            self.abandon()
            raise

    def _begin(self, info: bytes, log_ns: int) -> None:
        """Write the head of the file: every channel, and the information on the run."""
        self._writer.start(profile=f"{PROFILE}/{FORMAT}", library=f"echolocate {VERSION}")
        for topic, kind in CHANNELS.items():
            self._register(topic, kind.__name__, schema_of(kind))
        self.add(RUN_INFO, info, log_ns)
        self.flush()

    def _register(self, topic: str, name: str, schema: bytes) -> None:
        if name not in self._schemas:
            self._schemas[name] = self._writer.register_schema(name, "jsonschema", schema)
        self._channels[topic] = self._writer.register_channel(topic, "json", self._schemas[name])

    def add(self, topic: str, data: bytes, log_ns: int, sequence: int = 0) -> None:
        """Add a message, JSON of one of `CHANNELS`, to the current chunk.

        `log_ns` is a Unix time in ns, `sequence` the number of the cycle where there is one.
        """
        self._writer.add_message(self._channels[topic], log_ns, data, log_ns, sequence)

    @property
    def bytes(self) -> int:
        """Size of the file so far."""
        return self._file.tell()

    def flush(self) -> None:
        """Finish the current chunk and hand it to the system: then it survives the death of this process."""
        self._writer.flush()

    def sync(self) -> None:
        """Wait until all flushed data are on the disk: then they survive a power cut."""
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
        """Close the file as it is; every flushed chunk stays readable."""
        with contextlib.suppress(OSError):
            self._file.close()
