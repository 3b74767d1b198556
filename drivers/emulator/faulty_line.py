"""The robot's end of its line: the transmitter, and the faults of the line in both directions."""

from __future__ import annotations

import numpy as np

from drivers.emulator.fault_schedule import FaultSchedule, flip_bits
from drivers.emulator.faults import BitErrors, Deaf, Garbage, Mute, Unplug
from drivers.emulator.uart import Uart


class FaultyLine:
    """The bytes of a robot on their way to the host and from it.

    Parameters
    ----------
    baud
        Speed of the transmitter.
    faults
        Those that are active: the owner of the schedule sets them. It calls `collect` before it changes them.
    output_rng, input_rng
        Sources of random bytes and bit errors, by direction.
    """

    def __init__(
        self, baud: int, faults: FaultSchedule, output_rng: np.random.Generator, input_rng: np.random.Generator
    ) -> None:
        self._uart = Uart(baud)
        self._faults = faults
        self._output_rng, self._input_rng = output_rng, input_rng
        self._outbox = bytearray()

    @property
    def plugged(self) -> bool:
        """False while the line is unplugged."""
        return not self._faults.has(Unplug)

    @property
    def dropped(self) -> int:
        """Number of frames that did not fit into the transmitter's queue."""
        return self._uart.dropped

    @property
    def empty_us(self) -> int | None:
        """When the last byte in the queue will have left, µs; None if the queue is empty."""
        return self._uart.empty_us

    def heard(self, data: bytes) -> bytes:
        """Return what arrives of bytes from the host."""
        if not self.plugged or self._faults.has(Deaf):
            return b""
        for bit_errors in self._faults.all(BitErrors):
            data = flip_bits(data, bit_errors.rate, self._input_rng)
        return data

    def send(self, frame: bytes, now_us: int) -> None:
        """Queue a frame."""
        for bit_errors in self._faults.all(BitErrors):
            frame = flip_bits(frame, bit_errors.rate, self._output_rng)
        self._transmit(frame, now_us)

    def add_garbage(self, now_us: int, period_us: int) -> None:
        """Queue the random bytes of one period, if it is time for them."""
        for garbage in self._faults.all(Garbage):
            if now_us % period_us == 0:
                count = max(1, round(garbage.bytes_per_s * period_us * 1e-6))
                self._transmit(self._output_rng.bytes(count), now_us)

    def collect(self, now_us: int) -> None:
        """Collect what has left the transmitter; bytes sent into an unplugged line are lost."""
        left = self._uart.take(now_us)
        if left and self.plugged:
            self._outbox += left

    def take(self) -> bytes:
        """Return the bytes collected, and remove them."""
        if not self._outbox:
            return b""
        left = bytes(self._outbox)
        self._outbox.clear()
        return left

    def set_baud(self, baud: int, now_us: int) -> None:
        """Change the transmitter's speed."""
        self.collect(now_us)
        self._uart.set_baud(baud, now_us)

    def clear(self) -> None:
        """Drop the bytes that have not left."""
        self._uart.clear()

    def _transmit(self, data: bytes, now_us: int) -> None:
        self.collect(now_us)
        if not self._faults.has(Mute):
            self._uart.send(data, now_us)
