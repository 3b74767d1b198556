"""The line to the host on a serial port of the board. Neither read nor write waits."""


class UartLine:
    """A serial port of the board; `uart` is a `machine.UART` with `timeout=0`."""

    def __init__(self, uart) -> None:
        self._uart = uart
        self._byte = bytearray(1)

    def read(self) -> int:
        """Return the next byte, -1 if there is none."""
        return self._byte[0] if self._uart.any() and self._uart.readinto(self._byte) == 1 else -1

    def write(self, data: memoryview) -> None:
        """Send a frame; what does not fit into the transmitter's buffer is lost."""
        self._uart.write(data)

    def release(self) -> None:
        """Do nothing: the console is elsewhere."""
