"""The firing pattern: which sensors fire in which step, and the echo frame of each step."""

from struct import pack_into, unpack_from

from micropython import const

from ring.clock import Clock, sleep_us, ticks_add, ticks_diff
from ring.pulse_sensors import FAULT
from ring.wire import Encoder

_ECHO = const(0x91)
_ECHO2 = const(0x92)
_ECHO3 = const(0x93)
RANGE_UNIT_UM = 172
"""A count of ECHO2, µm: about a microsecond of flight at 343 m/s."""
_NO_ECHO_COUNT = const(0xFFFF)
_MASKS_MAX = const(24)
_WINDOW_MIN = const(5)
_WINDOW_UM = const(30_480)
_SOUND_M_S = const(343)
_STAGGER_US = const(150)
"""Between triggers of one step, so that interrupts of pulses that begin do not wait for one another."""


def window_us(window: int) -> int:
    """Return the time of flight to the end of a window in tenths of a foot and back, µs."""
    return (2 * window * _WINDOW_UM + _SOUND_M_S - 1) // _SOUND_M_S


def echo_count(flight_us: int) -> int:
    """Return the count of ECHO2 for a time of flight, `NO_ECHO` or `FAULT`."""
    if flight_us < 0:
        return 0 if flight_us == FAULT else _NO_ECHO_COUNT
    return min(_NO_ECHO_COUNT - 1, max(1, (_SOUND_M_S * flight_us + RANGE_UNIT_UM) // (2 * RANGE_UNIT_UM)))


def echo_byte(flight_us: int) -> int:
    """Return the byte of ECHO for a time of flight, `NO_ECHO` or `FAULT`: tenths of a foot."""
    if flight_us < 0:
        return 0 if flight_us == FAULT else 255
    return min(254, max(5, (_SOUND_M_S * flight_us + _WINDOW_UM) // (2 * _WINDOW_UM)))


class Firing:
    """Fires the sensors step by step, and sends what they heard when the window has closed.

    Sensors are given counter-clockwise from forward; `encoder` takes the frames. `scan` is None without servos.
    """

    def __init__(self, sensors: tuple, clock: Clock, encoder: Encoder, scan=None) -> None:
        self.scan = scan
        self.version = 2
        self._sensors = sensors
        self._clock = clock
        self._encoder = encoder
        self._masks = self._next_masks = ()
        self._period_us = self._next_period_us = 0
        self._window_us = self._next_window_us = 0
        self._changed = False
        self._step = 0
        self._due = 0
        self._fired = 0
        self._fired_step = 0
        self._fired_at = 0
        self._closes = 0
        self._closing = False

    def set_pattern(self, payload: memoryview) -> int:
        """Take the payload of a PATTERN: from the next step on; return 0, or the code of a NAK."""
        if len(payload) < 4 or len(payload) != 4 + 3 * payload[0]:
            return 2
        count, period_ms, window = unpack_from("<BHB", payload)
        masks = tuple(payload[k] | payload[k + 1] << 8 | payload[k + 2] << 16 for k in range(4, len(payload), 3))
        flight_us = window_us(window)
        if count > _MASKS_MAX or window < _WINDOW_MIN:
            return 3
        if count and (1000 * period_ms < flight_us or not all(self._possible(mask) for mask in masks)):
            return 3
        if not self._rested(masks, 1000 * period_ms):
            return 3
        self._next_masks, self._next_period_us, self._next_window_us = masks, 1000 * period_ms, flight_us
        self._changed = True
        if self.scan is not None:
            self.scan.on = 0
        if not self._masks:
            self._due = self._clock.poll()
        return 0

    def _possible(self, mask: int) -> bool:
        """Return whether these sensors can fire together: each exists, and all that fire have their own echo pin."""
        sensors = self._sensors
        if mask >> len(sensors):
            return False
        asked = [sensors[i] for i in range(len(sensors)) if mask >> i & 1 and sensors[i].timer]
        triggers = [sensor.trigger for sensor in asked]
        timers = [sensor.timer for sensor in sensors if sensor.trigger in triggers]
        return all(timers.count(timer) == 1 for timer in timers)

    def _rested(self, masks: tuple, period_us: int) -> bool:
        """Return whether each sensor has the rest that it needs between two of its firings."""
        for i, sensor in enumerate(self._sensors):
            steps = [k for k, mask in enumerate(masks) if mask >> i & 1]
            for k, step in enumerate(steps):
                later = steps[k + 1] if k + 1 < len(steps) else steps[0] + len(masks)
                if (later - step) * period_us < sensor.kind.cycle_us:
                    return False
        return True

    def idle_us(self) -> int:
        """Return for how long nothing is due, µs; negative while an echo is awaited."""
        if self._closing:
            return -1
        return ticks_diff(self._due, self._clock.ticks) if self._masks or self._changed else 1_000_000

    def poll(self) -> bool:
        """Do what is due; return True after an echo frame was sent."""
        now = self._clock.ticks
        sent = False
        if self._closing and ticks_diff(now, self._closes) >= 0:
            self._report()
            sent = True
        if (self._masks or self._changed) and ticks_diff(now, self._due) >= 0 and not self._closing:
            self._start(now)
        return sent

    def _start(self, now: int) -> None:
        """Fire the sensors of the next step, staggered by their triggers, and note when the window closes."""
        if self._changed:
            self._masks, self._window_us = self._next_masks, self._next_window_us
            self._period_us = self._next_period_us
            self._changed, self._step = False, 0
            for sensor in self._sensors:
                sensor.prepare(self._window_us)
            if not self._masks:
                return
        self._fired, self._fired_step = self._masks[self._step], self._step
        self._step = (self._step + 1) % len(self._masks)
        delay_us = 0
        triggers = []
        for i, sensor in enumerate(self._sensors):
            if self._fired >> i & 1:
                sensor.arm(self._window_us)
                delay_us = max(delay_us, sensor.kind.delay_us)
        self._fired_at = self._clock.poll()
        for i, sensor in enumerate(self._sensors):
            if self._fired >> i & 1 and (sensor.trigger is None or sensor.trigger not in triggers):
                if triggers:
                    sleep_us(_STAGGER_US)
                triggers.append(sensor.trigger)
                sensor.fire()
        # Steps keep their time, unless the board was kept busy for more than a step.
        if ticks_diff(now, self._due) > self._period_us:
            self._due = now
        self._due = ticks_add(self._due, self._period_us)
        self._closes = ticks_add(self._fired_at, self._window_us + delay_us)
        if ticks_diff(self._closes, self._due) > 0:
            self._closes = self._due
        self._closing = True

    def _report(self) -> None:
        """Send the echoes of the step whose window has closed, in the frame that the version has."""
        self._closing = False
        frame = self._encoder.frame
        pack_into("<IB", frame, 2, self._clock.t_us(self._fired_at), self._fired_step)
        fine = self.version > 1
        on = self.scan.on if fine and self.scan is not None else 0
        _put_mask(frame, 7, self._fired)
        at = 10
        if fine:
            _put_mask(frame, 10, self._fired & on)
            at = 13
        for i, sensor in enumerate(self._sensors):
            if self._fired >> i & 1:
                flight_us = sensor.finish(self._window_us)
                if fine:
                    pack_into("<H", frame, at, echo_count(flight_us))
                    at += 2
                else:
                    frame[at] = echo_byte(flight_us)
                    at += 1
        if on:
            self._encoder.send(_ECHO3, self.scan.report(frame, at, self._fired & on) - 2)
        else:
            self._encoder.send(_ECHO2 if fine else _ECHO, at - 2)


def _put_mask(frame: bytearray, at: int, mask: int) -> None:
    frame[at] = mask & 0xFF
    frame[at + 1] = mask >> 8 & 0xFF
    frame[at + 2] = mask >> 16
