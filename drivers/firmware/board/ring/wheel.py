"""One driven wheel: its motor on an H-bridge, its quadrature encoder, and the control of its speed."""

from machine import PWM, Pin
from micropython import const

_FULL = const(65535)
_STALL_DUTY = 0.6
"""A motor that gets more of the supply than this and does not turn, or turns the other way, or so it seems by its
encoder, is faulty or wired wrongly."""
_STALL_S = 0.4
_PROPORTIONAL, _INTEGRAL = 0.6, 12.0
"""Supply for a speed that is missing, of that for the speed itself; and, 1/s, for a way that is missing."""
_ERROR_MAX_MM = 15.0
"""The farthest that the control remembers the wheel to be behind, mm."""
_QUARTERS = b"\x00\xff\x01\x00\x01\x00\x00\xff\xff\x00\x00\x01\x00\x01\xff\x00"
"""Counts of a step of the encoder, by its state before (A, B: the higher two bits) and after; 255 is −1.

Forward is where A changes before B."""


class IrqEncoder:
    """Counts the edges of both phases by interrupts: 4 a period."""

    def __init__(self, a: int, b: int) -> None:
        self._a, self._b = Pin(a, Pin.IN, Pin.PULL_UP), Pin(b, Pin.IN, Pin.PULL_UP)
        self._count = 0
        self._state = self._a.value() << 1 | self._b.value()
        edges = Pin.IRQ_RISING | Pin.IRQ_FALLING
        for pin in (self._a, self._b):
            try:
                pin.irq(self._edge, edges, hard=True)
            except (TypeError, ValueError):  # the ESP32 has none
                pin.irq(self._edge, edges)

    def _edge(self, _pin: Pin) -> None:
        state = self._a.value() << 1 | self._b.value()
        step = _QUARTERS[self._state << 2 | state]
        self._state = state
        self._count += step if step < 2 else -1

    def value(self) -> int:
        """Return the count."""
        return self._count


def make_encoder(number: int, a: int, b: int):
    """Return the board's own counter of quadrature edges if it has one, or one by interrupts."""
    try:
        from machine import Encoder
    except ImportError:
        return IrqEncoder(a, b)
    return Encoder(number, Pin(a, Pin.IN, Pin.PULL_UP), Pin(b, Pin.IN, Pin.PULL_UP), phases=4)


class Wheel:
    """A wheel, whose control follows the position that the speed asked for would have reached.

    Parameters
    ----------
    motor
        Pins of the H-bridge: IN1, IN2, PWM.
    encoder
        With a method `value`, which grows when the wheel turns forward.
    counts_per_m
        Of the encoder, a metre of way; negative if it counts backward.
    full_mm_s
        Speed at the full supply, without load.
    """

    def __init__(self, motor: tuple, encoder, counts_per_m: float, full_mm_s: float) -> None:
        self._in1, self._in2 = Pin(motor[0], Pin.OUT, value=0), Pin(motor[1], Pin.OUT, value=0)
        self._pwm = PWM(Pin(motor[2]), freq=20_000, duty_u16=0)
        self._encoder = encoder
        self._mm_per_count = 1000.0 / counts_per_m
        self._full_mm_s = full_mm_s
        self._last = encoder.value()
        self._behind_mm = 0.0
        self._stalled_s = 0.0
        self.moved_mm = 0.0
        self.count = 0
        self.speed_mm_s = 0.0

    def measure(self, dt_s: float) -> None:
        """Read the encoder after `dt_s`: `moved_mm` since the last time, `speed_mm_s`, `count` since the start."""
        count = self._encoder.value()
        step = count - self._last
        self._last = count
        self.count += step
        self.moved_mm = step * self._mm_per_count
        self.speed_mm_s += 0.4 * (self.moved_mm / dt_s - self.speed_mm_s)

    def drive(self, mm_s: float, dt_s: float) -> bool:
        """Turn at a speed; return False if the wheel does not turn although it gets the supply to."""
        error = self._behind_mm + mm_s * dt_s - self.moved_mm
        self._behind_mm = max(-_ERROR_MAX_MM, min(_ERROR_MAX_MM, error))
        duty = (mm_s + _PROPORTIONAL * (mm_s - self.speed_mm_s) + _INTEGRAL * self._behind_mm) / self._full_mm_s
        duty = max(-1.0, min(1.0, duty))
        self._in1.value(duty > 0.0)
        self._in2.value(duty < 0.0)
        self._pwm.duty_u16(int(abs(duty) * _FULL))
        stalled = abs(duty) > _STALL_DUTY and duty * self.moved_mm <= 0.0
        self._stalled_s = self._stalled_s + dt_s if stalled else 0.0
        return self._stalled_s < _STALL_S

    def brake(self) -> None:
        """Stop at once: short the motor, and forget where the wheel should be."""
        self._behind_mm = self._stalled_s = 0.0
        self._in1.value(1)
        self._in2.value(1)
        self._pwm.duty_u16(_FULL)
