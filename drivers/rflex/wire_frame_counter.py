"""Count the frames whose latency is traced: sonar reports to the host, and velocities from it."""

from __future__ import annotations

from drivers.rflex.codec import MOTOR, MOTOR_SET_DIR, SONAR, SONAR_REPORT, TRANSLATION, Decoder


class WireFrameCounter:
    """A `drivers.emulator.latency_trace.FrameCounter` for the rFLEX protocol."""

    def __init__(self) -> None:
        self._to_host, self._from_host = Decoder(), Decoder()

    def echoes(self, sent: bytes) -> int:
        """Return how many sonar reports the bytes sent to the host complete."""
        return sum((frame.port, frame.opcode) == (SONAR, SONAR_REPORT) for frame in self._to_host.feed(sent))

    def drives(self, received: bytes) -> int:
        """Return how many translations the bytes received from the host complete."""
        return sum(
            (frame.port, frame.opcode) == (MOTOR, MOTOR_SET_DIR) and frame.data[:1] == bytes((TRANSLATION,))
            for frame in self._from_host.feed(received)
        )
