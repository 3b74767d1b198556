"""Count the packets whose latency is traced: SIPs with new ranges to the host, and velocities from it."""

from __future__ import annotations

from drivers.arcos.codec import Decoder, decode_command, decode_packet
from drivers.arcos.commands import CommandNumber
from drivers.arcos.frames import Sip


class WireFrameCounter:
    """A `drivers.emulator.latency_trace.FrameCounter` for the Pioneer's protocol."""

    def __init__(self) -> None:
        self._to_host = Decoder(decode_packet)
        self._from_host = Decoder(decode_command)

    def echoes(self, sent: bytes) -> int:
        """Return how many SIPs with new ranges the bytes sent to the host complete."""
        return sum(isinstance(packet, Sip) and bool(packet.sonar) for packet in self._to_host.feed(sent))

    def drives(self, received: bytes) -> int:
        """Return how many velocities the bytes received from the host complete."""
        velocities = (CommandNumber.VEL, CommandNumber.VEL2)
        return sum(command.number in velocities for command in self._from_host.feed(received))
