"""The base: two wheels, odometry, and what stops them: latch, deadman, bumper, a motor that does not turn."""

from math import cos, sin

from micropython import const

from ring.clock import ticks_diff, ticks_us

_LATCHED = const(1)
_BUMPER = const(2)
_MOTOR_FAULT = const(4)
_DEADMAN = const(8)
_BATTERY_LOW = const(16)
PERIOD_MS = 10
_RAMP_S = 0.2
"""After the deadman the base ramps from its full speed to a stop in this time."""


class Base:
    """A differential base; `tick` is called every `PERIOD_MS`, by a timer, so that nothing else can delay a stop.

    `config` is the module `robot_config`, `bumper` a pin that a contact pulls low, or None; `battery_low()` says
    whether the battery is low.

    Attributes
    ----------
    x, y, heading
        Odometry, in the protocol's units: .1 mm, .1 mm, 1e-4 rad.
    v, w
        Speed measured, mm/s and mrad/s.
    flags, drive_seq
        As in ODOM.
    """

    def __init__(self, config, left, right, bumper, battery_low) -> None:
        self._config = config
        self._left, self._right = left, right
        self._bumper = bumper
        self._battery_low = battery_low
        self._half_base_mm = config.WHEEL_BASE_MM / 2
        self._rad_per_count = 1e3 / config.ENCODER_COUNTS_PER_M / config.WHEEL_BASE_MM
        self._target_v = self._target_w = 0.0
        self._v = self._w = 0.0
        self._x_rest = self._y_rest = 0.0
        self._ticks = self._drive_ticks = ticks_us()
        self.x = self.y = self.heading = 0
        self.v = self.w = 0
        self.flags = 0
        self.drive_seq = 0

    def drive(self, v_mm_s: int, w_mrad_s: int, seq: int) -> bool:
        """Obey a DRIVE; return False while latched."""
        if self.flags & _LATCHED:
            return False
        config = self._config
        self._target_v = max(-config.SPEED_MAX_MM_S, min(config.SPEED_MAX_MM_S, v_mm_s))
        self._target_w = max(-config.TURN_MAX_MRAD_S, min(config.TURN_MAX_MRAD_S, w_mrad_s))
        self._drive_ticks = ticks_us()
        self.drive_seq = seq
        self.flags &= ~_DEADMAN
        return True

    def halt(self, reason: int = 0) -> None:
        """Stop at once and latch."""
        self.flags |= _LATCHED | reason
        self._target_v = self._target_w = self._v = self._w = 0.0
        self._left.brake()
        self._right.brake()

    def release(self) -> None:
        """Clear the latch; a bumper that is still pressed latches again. Nothing moves before the next DRIVE."""
        self._target_v = self._target_w = 0.0
        self.flags &= _DEADMAN | _BATTERY_LOW
        self._check_bumper()

    def tick(self, _timer=None) -> None:
        """Measure and control the wheels; stop them if that fails, as nothing else would."""
        try:
            self._control()
        except Exception:  # noqa: BLE001 - a timer only reports it, and the motors would go on as they are
            self.halt(_MOTOR_FAULT)

    def _control(self) -> None:
        """Measure the wheels, check bumper, battery and deadman, and drive towards the target unless latched."""
        now = ticks_us()
        dt_s = ticks_diff(now, self._ticks) * 1e-6
        if dt_s <= 0.0:
            return
        self._ticks = now
        self._left.measure(dt_s)
        self._right.measure(dt_s)
        self._integrate()
        self._check_bumper()
        self.flags = self.flags | _BATTERY_LOW if self._battery_low() else self.flags & ~_BATTERY_LOW
        if ticks_diff(now, self._drive_ticks) >= 1000 * self._config.DEADMAN_MS:
            self._drive_ticks = now  # the counter wraps: only the flag remembers
            self.flags |= _DEADMAN
            self._target_v = self._target_w = 0.0
        if self.flags & _LATCHED:
            return
        self._ramp(dt_s)
        if self._v == 0.0 and self._w == 0.0:
            self._left.brake()
            self._right.brake()
            return
        turn = self._w * self._half_base_mm * 1e-3
        turning = self._left.drive(self._v - turn, dt_s)
        if not (self._right.drive(self._v + turn, dt_s) and turning):
            self.halt(_MOTOR_FAULT)

    def _ramp(self, dt_s: float) -> None:
        """Bring the speed asked for nearer to the target; faster where the deadman stops the base."""
        config = self._config
        dv, dw = config.ACCELERATION_MM_S2 * dt_s, config.TURN_ACCELERATION_MRAD_S2 * dt_s
        if self.flags & _DEADMAN:
            dv = max(dv, config.SPEED_MAX_MM_S * dt_s / _RAMP_S)
            dw = max(dw, config.TURN_MAX_MRAD_S * dt_s / _RAMP_S)
        self._v += max(-dv, min(dv, self._target_v - self._v))
        self._w += max(-dw, min(dw, self._target_w - self._w))

    def _integrate(self) -> None:
        """Add the arc that the wheels have driven; whole .1 mm are kept apart, which single precision would lose."""
        left, right = self._left, self._right
        before = self.heading * 1e-4
        heading = (right.count - left.count) * self._rad_per_count
        way = 5.0 * (left.moved_mm + right.moved_mm)
        middle = 0.5 * (before + heading)
        self._x_rest += way * cos(middle)
        self._y_rest += way * sin(middle)
        whole = int(self._x_rest)
        self.x += whole
        self._x_rest -= whole
        whole = int(self._y_rest)
        self.y += whole
        self._y_rest -= whole
        self.heading = round(heading * 1e4)
        self.v = round(0.5 * (left.speed_mm_s + right.speed_mm_s))
        self.w = round((right.speed_mm_s - left.speed_mm_s) * 1e3 / (2 * self._half_base_mm))

    def _check_bumper(self) -> None:
        if self._bumper is not None and not self._bumper.value() and not self.flags & _BUMPER:
            self.halt(_BUMPER)
