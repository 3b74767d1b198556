"""Devantech SRF08 and SRF10: sensors on I2C that measure the time of flight themselves."""

from micropython import const

from ring.pulse_sensors import FAULT, NO_ECHO, Kind

_COMMAND = const(0)
_RANGE = const(2)
_ECHO = const(2)
_MICROSECONDS = b"\x52"
_BUSY = const(0xFF)
_RANGE_STEP_UM = const(43_000)
"""Its range register counts steps of 43 mm."""
_SOUND_HALF_M_S = const(171)


class I2cSensor:
    """One sensor at an address (7 bits); a failure of the bus is its fault, and no other's."""

    def __init__(self, i2c, address: int) -> None:
        self.kind = Kind(0, 1.0, 5000, 0)
        self.trigger = None
        self.timer = None
        self._i2c = i2c
        self._address = address
        self._byte, self._echo = bytearray(1), bytearray(2)
        self._failed = False
        self._steps, self._steps_set = 255, -1

    def prepare(self, window_us: int) -> None:
        """Limit how far the sensor listens from the next firing on, so that it is done in time."""
        self._steps = min(255, window_us * _SOUND_HALF_M_S // _RANGE_STEP_UM + 1)

    def arm(self, _window_us: int) -> None:
        """Do nothing: the sensor times its echo itself."""

    def fire(self) -> None:
        """Send the burst."""
        try:
            if self._steps != self._steps_set:
                self._byte[0] = self._steps
                self._i2c.writeto_mem(self._address, _RANGE, self._byte)
                self._steps_set = self._steps
            self._i2c.writeto_mem(self._address, _COMMAND, _MICROSECONDS)
            self._failed = False
        except OSError:
            self._failed, self._steps_set = True, -1

    def finish(self, window_us: int) -> int:
        """Return the flight, µs, or `NO_ECHO` inside the window, or `FAULT`."""
        if self._failed:
            return FAULT
        try:
            self._i2c.readfrom_mem_into(self._address, _COMMAND, self._byte)
            if self._byte[0] == _BUSY:  # it does not answer while it listens
                return FAULT
            self._i2c.readfrom_mem_into(self._address, _ECHO, self._echo)
        except OSError:
            return FAULT
        flight_us = self._echo[0] << 8 | self._echo[1]
        return flight_us if 0 < flight_us <= window_us else NO_ECHO
