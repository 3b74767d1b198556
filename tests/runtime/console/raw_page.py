"""A client of the console that writes the bytes of its websocket itself, so that it can break every rule."""

from __future__ import annotations

import asyncio
import base64
import contextlib
import os
import struct
from collections.abc import AsyncIterator
from dataclasses import dataclass

from tests.hil.machine import TIMEOUT_S
from tests.runtime.console.console_case import ConsoleCase


@dataclass
class RawPage:
    """A websocket whose every frame the test writes."""

    reader: asyncio.StreamReader
    writer: asyncio.StreamWriter

    def write(
        self, opcode: int, payload: bytes = b"", *, fin: bool = True, compressed: bool = False, count: int = 1
    ) -> None:
        """Write a frame, masked with zeros, so many times."""
        first = bytes([opcode | (0x80 if fin else 0) | (0x40 if compressed else 0)])
        size = bytes([0x80 | len(payload)]) if len(payload) < 126 else b"\xfe" + struct.pack(">H", len(payload))
        self.writer.write((first + size + bytes(4) + payload) * count)

    async def rest(self) -> bytes:
        """Return what the server sends until it drops the connection."""
        received = bytearray()
        with contextlib.suppress(ConnectionError):
            while data := await asyncio.wait_for(self.reader.read(65_536), TIMEOUT_S):
                received += data
        return bytes(received)


@contextlib.asynccontextmanager
async def raw_page(case: ConsoleCase, *headers: str) -> AsyncIterator[RawPage]:
    """Connect a websocket by hand; the server agrees to no extension."""
    reader, writer = await asyncio.open_connection("127.0.0.1", case.url.port)
    lines = [
        f"GET /ws?token={case.token} HTTP/1.1", f"Host: 127.0.0.1:{case.url.port}", f"Origin: {case.origin}",
        "Upgrade: websocket", "Connection: Upgrade", "Sec-WebSocket-Version: 13",
        f"Sec-WebSocket-Key: {base64.b64encode(os.urandom(16)).decode()}", *headers, "", "",
    ]  # fmt: skip
    writer.write("\r\n".join(lines).encode())
    answer = await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), TIMEOUT_S)
    assert answer.startswith(b"HTTP/1.1 101")
    assert b"extensions" not in answer.lower()
    try:
        yield RawPage(reader, writer)
    finally:
        writer.transport.abort()
        with contextlib.suppress(ConnectionError):
            await writer.wait_closed()
