"""Count the frames whose latency is traced: echoes to the host, and drive commands from it."""

from __future__ import annotations

from drivers.denning.codec import Decoder
from drivers.denning.frames import Drive, Echo, Echo2, Echo3


class WireFrameCounter:
    """A `drivers.emulator.latency_trace.FrameCounter` for the ring-and-base protocol."""

    def __init__(self) -> None:
        self._to_host = Decoder("robot", midway=True)
        self._from_host = Decoder("host", midway=True)

    def echoes(self, sent: bytes) -> int:
        """Return how many frames of echoes, of any version, the bytes sent to the host complete."""
        return sum(isinstance(frame, Echo | Echo2 | Echo3) for frame in self._to_host.feed(sent))

    def drives(self, received: bytes) -> int:
        """Return how many DRIVE frames the bytes received from the host complete."""
        return sum(isinstance(frame, Drive) for frame in self._from_host.feed(received))
