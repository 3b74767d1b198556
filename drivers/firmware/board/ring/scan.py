"""Sensors on servos: after each of its firings a servo goes on to the next bearing of its scan."""

from struct import pack_into, unpack_from

from machine import PWM, Pin
from micropython import const

_SWEEP_BYTES = const(7)
_QUARTER = const(15708)
"""A quarter turn in the protocol's bearings of 1e-4 rad."""
_TURN = const(62832)
_PULSE_MIN_US, _PULSE_MAX_US = const(400), const(2600)
_PERIOD_US = const(20_000)


class Servo:
    """A servo that follows a pulse of 1 to 2 ms, 50 times a second.

    At `ahead_us` its sensor looks ahead, at `left_us` a quarter turn to the left.
    """

    def __init__(self, pin: int, ahead_us: int, left_us: int) -> None:
        self._ahead_us, self._left_us = ahead_us, left_us
        self._first = self._step = 0
        self._count, self._endless = 1, 1
        self._k = 0
        self.bearing = 0
        self._pwm = PWM(Pin(pin), freq=50, duty_u16=self._duty(0))

    def _pulse_us(self, bearing: int) -> int:
        return self._ahead_us + (self._left_us - self._ahead_us) * bearing // _QUARTER

    def _duty(self, bearing: int) -> int:
        return self._pulse_us(bearing) * 65535 // _PERIOD_US

    def reaches(self, first: int, step: int, count: int) -> bool:
        """Return whether the servo goes to the first and last bearing of a sweep."""
        ends = first, first + step * (count - 1)
        return all(_PULSE_MIN_US <= self._pulse_us(end) <= _PULSE_MAX_US for end in ends)

    def start(self, first: int, step: int, count: int, endless: int) -> None:
        """Go to the first bearing of a sweep."""
        self._first, self._step, self._count, self._endless = first, step, count, endless
        self._k = -1
        self.go_on()

    def go_on(self) -> None:
        """Go to the next bearing."""
        count = self._count
        self._k = (self._k + 1) % (count if self._endless else 2 * count - 2)
        bearing = self._first + self._step * min(self._k, 2 * count - 2 - self._k if not self._endless else self._k)
        self._pwm.duty_u16(self._duty(bearing))
        self.bearing = (bearing + _TURN // 2) % _TURN - _TURN // 2


class Scan:
    """The servos of a ring, and which of them turn.

    Each is the sensor's number, its pin, and the pulses of `Servo`.
    """

    def __init__(self, servos: tuple) -> None:
        self._servos = {entry[0]: Servo(entry[1], entry[2], entry[3]) for entry in servos}
        self.on = 0

    def set(self, payload: memoryview) -> int:
        """Take the payload of a SCAN; return 0, or the code of a NAK."""
        if len(payload) < 1 or len(payload) != 1 + _SWEEP_BYTES * payload[0]:
            return 2
        sweeps = [unpack_from("<BhhBB", payload, k) for k in range(1, len(payload), _SWEEP_BYTES)]
        for sensor, first, step, count, _ in sweeps:
            if sensor not in self._servos or count < 2 or not self._servos[sensor].reaches(first, step, count):
                return 3
        if not sweeps:
            return 3
        self.on = 0
        for sensor, first, step, count, endless in sweeps:
            self._servos[sensor].start(first, step, count, endless)
            self.on |= 1 << sensor
        return 0

    def report(self, frame: bytearray, at: int, turned: int) -> int:
        """Write the bearings of sensors that fired, and turn them on; return where they end in the frame."""
        for sensor in range(24):
            if turned >> sensor & 1:
                pack_into("<h", frame, at, self._servos[sensor].bearing)
                self._servos[sensor].go_on()
                at += 2
        return at
