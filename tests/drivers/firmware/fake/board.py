"""A board, its robot and its world in virtual time: events, pins, interrupts, sensors with echoes, driven wheels.

Interrupts start 3 to 9 µs after their edge and take 12 µs, one after the other, as on a real board. Lists and bytes
instead of objects: the heap is the firmware's, and it is small.
"""

from utime import sleep_us
from utime import ticks_diff as real_diff
from utime import ticks_us as real_us

ISR_US = 12
RISE_DELAY_US = 450
NOTHING_US = 38_000
TOO_SHORT_US = 10
"""The pulse of a module that needs a longer trigger than it got."""
WHEEL_TICK_US = 1000
LAG_S = 0.04
FRICTION_MM_S = 2.0
OK, DEAD, HANGS = 0, 1, 2
PINS = 48
SENSORS = 24


class Wheel:
    """A motor with its encoder: first-order lag to the speed that its bridge asks for."""

    def __init__(self, motor, encoder) -> None:
        self.motor, self.encoder = motor, encoder
        self.speed = 0.0
        self.way_mm = 0.0
        self.count = 0
        self.blocked = False


class Board:
    """Sensors have a state (OK, DEAD: no pulse, HANGS: one without end), a width, or None for ever new ones."""

    def __init__(self) -> None:
        self.now = 0
        self.start = None
        self.idle_us = 100
        self.events = []
        self.levels = bytearray(PINS)
        self.handlers = {}
        self.machines = {}
        self.duties = {}
        self.triggers = {}
        self.echoes = bytearray(SENSORS)
        self.states = bytearray(SENSORS)
        self.widths = [None] * SENSORS
        self.fired = [0] * SENSORS
        self.trigger_min_us = 0
        self.raised_us = 0
        self.wheels = ()
        self.i2c = {}
        self.config = None
        self.pending = []
        self.in_isr = False
        self.isr_end = 0
        self.seed = 1

    # Time.

    def run_in_real_time(self) -> None:
        self.start, self.idle_us = real_us(), 1000

    def read_clock(self) -> int:
        if not self.in_isr:
            self.advance(2 if self.start is None else 0)
        return self.now

    def advance(self, us: int) -> None:
        until = self.now + us
        if self.start is not None:
            sleep_us(max(0, until - real_diff(real_us(), self.start)))
            until = max(self.now, real_diff(real_us(), self.start))
        while True:
            event_us = self.events[0][0] if self.events else until + 1
            isr_us = self.pending[0][0] if self.pending else until + 1
            if min(event_us, isr_us) > until:
                break
            at, do, argument = (self.events if event_us <= isr_us else self.pending).pop(0)
            self.now = max(self.now, at)
            self.in_isr = isr_us < event_us
            do(argument)
            self.in_isr = False
        self.now = max(self.now, until)

    def at(self, us: int, do, argument=None) -> None:
        k = len(self.events)
        while k and self.events[k - 1][0] > us:
            k -= 1
        self.events.insert(k, (us, do, argument))

    # Pins.

    def set_output(self, pin: int, level: int) -> None:
        if self.levels[pin] == level:
            return
        self.levels[pin] = level
        if level and pin in self.triggers:
            self.raised_us = self.now
        if not level and pin in self.triggers:
            for sensor in self.triggers[pin]:
                self.fire(sensor)

    def rise(self, pin: int) -> None:
        self.set_input(pin, 1)

    def fall(self, pin: int) -> None:
        self.set_input(pin, 0)

    def set_input(self, pin: int, level: int) -> None:
        if self.levels[pin] == level:
            return
        self.levels[pin] = level
        if pin in self.machines:
            self.machines[pin].edge(level, self.now)
        if pin in self.handlers:
            handler, edges, argument = self.handlers[pin]
            if edges & (1 if level else 2):
                self.interrupt(handler, argument)

    def interrupt(self, handler, argument) -> None:
        self.seed = (self.seed * 1103515245 + 12345) & 0x3FFFFFFF
        start_us = max(self.now, self.isr_end) + 3 + (self.seed >> 16) % 7
        self.isr_end = start_us + ISR_US
        self.pending.append((start_us, handler, argument))

    # The robot.

    def wire(self, config) -> None:
        """Connect what robot_config describes."""
        self.config = config
        for number, entry in enumerate(config.SENSORS):
            if entry[0] in ("srf08", "srf10"):
                self.i2c[entry[1]] = number
            else:
                self.echoes[number] = entry[2]
                self.triggers[entry[1]] = self.triggers.get(entry[1], ()) + (number,)
        self.trigger_min_us = getattr(config, "FAKE_TRIGGER_MIN_US", 0)
        for number in getattr(config, "FAKE_DEAD", ()):
            self.states[number] = DEAD
        encoders = getattr(config, "FAKE_ENCODERS", config.ENCODERS)
        for pins in encoders:
            for pin in pins:
                self.levels[pin] = 1
        self.wheels = tuple(Wheel(config.MOTORS[k], encoders[k]) for k in (0, 1))
        self.at(WHEEL_TICK_US, self.turn)

    def next_width(self, sensor: int) -> int:
        width = self.widths[sensor]
        fired = self.fired[sensor]
        self.fired[sensor] = fired + 1
        return 200 + (7919 * sensor + 10473 * fired) % 20_000 if width is None else width

    def fire(self, sensor: int) -> None:
        width, pin = self.next_width(sensor), self.echoes[sensor]
        if self.states[sensor] == DEAD:
            return
        rise = self.now + RISE_DELAY_US
        if self.now - self.raised_us < self.trigger_min_us:
            width = TOO_SHORT_US
        self.at(rise, self.rise, pin)
        if self.states[sensor] == OK:
            self.at(rise + width, self.fall, pin)

    def turn(self, _argument) -> None:
        dt = WHEEL_TICK_US * 1e-6
        for wheel in self.wheels:
            in1, in2, pwm = wheel.motor
            ask = self.levels[in1] - self.levels[in2]
            ask *= self.config.FULL_SPEED_MM_S * self.duties.get(pwm, 0) / 65535
            wheel.speed += (ask - wheel.speed) * dt / LAG_S
            if wheel.blocked or (ask == 0.0 and abs(wheel.speed) < FRICTION_MM_S):
                wheel.speed = 0.0
            wheel.way_mm += wheel.speed * dt
            way = wheel.way_mm * self.config.ENCODER_COUNTS_PER_M / 1000.0
            steps = int(way) - wheel.count
            for k in range(abs(steps)):
                wheel.count += 1 if steps > 0 else -1
                state = b"\x03\x02\x00\x01"[-wheel.count % 4]
                self.at(self.now + (k + 1) * WHEEL_TICK_US // (abs(steps) + 1), self.show, (wheel.encoder, state))
        self.at(self.now + WHEEL_TICK_US, self.turn)

    def show(self, shown) -> None:
        (a, b), state = shown
        self.set_input(a, state >> 1)
        self.set_input(b, state & 1)


BOARD = Board()
