"""A page reduced to its socket: it connects, sends what the test asks for, and reads or does not, without a loop."""

from __future__ import annotations

import base64
import json
import os
import socket
import struct
import threading
import time
from typing import Any
from urllib.parse import parse_qs, urlsplit

from tests.hil.machine import TIMEOUT_S

READ_BYTES = 65_536


class RawPage:
    """A websocket to an operator console, by its start URL.

    Parameters
    ----------
    url : str
        With the token.
    receive_bytes : int, optional
        What the system keeps for it at most while it does not read.
    """

    def __init__(self, url: str, receive_bytes: int | None = None) -> None:
        parts = urlsplit(url)
        token = parse_qs(parts.query)["token"][0]
        self.socket = socket.socket()
        self.socket.settimeout(TIMEOUT_S)
        if receive_bytes is not None:
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_bytes)
        self.socket.connect((parts.hostname, parts.port))
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        key = base64.b64encode(os.urandom(16)).decode()
        self.socket.sendall(
            f"GET /ws?token={token} HTTP/1.1\r\nHost: {parts.netloc}\r\nOrigin: http://{parts.netloc}\r\n"
            f"Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
            f"Sec-WebSocket-Key: {key}\r\n\r\n".encode()
        )
        self._challenge: int | None = None
        self._rest = b""
        while b"\r\n\r\n" not in self._rest:
            self._rest += self._more()
        head, _, self._rest = self._rest.partition(b"\r\n\r\n")
        if not head.startswith(b"HTTP/1.1 101"):
            raise ConnectionError(head.decode("latin-1").splitlines()[0])

    def say(self, **message: Any) -> None:
        """Send a message with the newest challenge read; its number is 1 where none is given."""
        if self._challenge is None:
            self.next("challenge")
        data = json.dumps({"id": 1, "challenge": self._challenge, **message}).encode()
        length = bytes([0x80 | len(data)]) if len(data) < 126 else b"\xfe" + struct.pack(">H", len(data))
        # A mask of zeros leaves the text as it is.
        self.socket.sendall(b"\x81" + length + bytes(4) + data)

    def next(self, *kinds: str) -> dict[str, Any]:
        """Return the next message of some kind, or the next of all where none is named."""
        end_s = time.monotonic() + TIMEOUT_S
        while True:
            if time.monotonic() > end_s:
                raise TimeoutError(f"no message of {kinds}")
            data = self._take(2)
            length = data[1]
            if length >= 126:
                length = int.from_bytes(self._take(2 if length == 126 else 8), "big")
            payload = self._take(length)
            if data[0] & 0x0F == 8:
                raise ConnectionError(f"closed: {payload!r}")
            if data[0] & 0x0F == 1:
                message: dict[str, Any] = json.loads(payload)
                if message["type"] == "challenge":
                    self._challenge = message["number"]
                if not kinds or message["type"] in kinds:
                    return message

    def ask(self, **message: Any) -> dict[str, Any]:
        """Say something and return the next answer; say it again while it arrives late, as a person would."""
        while True:
            self.say(**message)
            answer = self.next("answer")
            if "press again" not in str(answer["error"]):
                return answer
            self.next("challenge")

    def read_on(self) -> threading.Thread:
        """Have everything that comes read and forgotten, from now on."""

        if self._challenge is None:
            self.next("challenge")

        def work() -> None:
            try:
                while True:
                    self.next()  # keeps the newest challenge
            except OSError:
                pass

        reader = threading.Thread(target=work, name="page", daemon=True)
        reader.start()
        return reader

    def cut(self) -> None:
        """Be gone at once, without a word, as a page whose machine lost its network and then came back."""
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self.socket.close()

    def close(self) -> None:
        """Close the socket."""
        self.socket.close()

    def _take(self, count: int) -> bytes:
        while len(self._rest) < count:
            self._rest += self._more()
        data, self._rest = self._rest[:count], self._rest[count:]
        return data

    def _more(self) -> bytes:
        data = self.socket.recv(READ_BYTES)
        if not data:
            raise ConnectionError("closed")
        return data
