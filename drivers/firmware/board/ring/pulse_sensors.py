"""Sensors that answer a trigger with a pulse as long as their echo's flight: HC-SR04 and relatives, MB10xx, MB12xx.

Sensors may share a trigger pin, and then fire together; and an echo pin, through diodes, if they never fire together.
"""

from machine import Pin

from ring.clock import sleep_us

NO_ECHO, FAULT = -1, -2
"""What `finish` returns besides a time of flight."""


class Kind:
    """What differs between sensors: trigger length, flight per pulse length, delay of the pulse, rest, all in µs."""

    def __init__(self, trigger_us: int, scale: float, delay_us: int, cycle_us: int) -> None:
        self.trigger_us = trigger_us
        self.scale = scale
        self.delay_us = delay_us
        self.cycle_us = cycle_us


def kind_of(name: str, trigger_us: int) -> Kind:
    """Return the kind of a sensor by its name in robot_config.py, and the length of an hc-sr04's trigger.

    MaxBotix define their pulse as 147 µs an inch (LV) and 58 µs a centimetre (XL); the flight is at 343 m/s.
    """
    if name == "hc-sr04":
        return Kind(trigger_us, 1.0, 3000, 0)
    if name == "mb10xx":
        return Kind(25, 2 * 25400 / 147 / 343, 3000, 49_000)
    if name == "mb12xx":
        return Kind(25, 2 * 10000 / 58 / 343, 3000, 99_000)
    raise ValueError("robot_config.SENSORS: unknown kind " + name)


class PulseSensor:
    """One sensor: its trigger pin, and the timer of its echo pin."""

    def __init__(self, kind: Kind, trigger: Pin, timer) -> None:
        self.kind = kind
        self.trigger = trigger
        self.timer = timer
        self._hangs = False

    def prepare(self, _window_us: int) -> None:
        """Do nothing: only the firmware limits how far such a sensor listens."""

    def arm(self, window_us: int) -> None:
        """Expect a pulse."""
        self._hangs = bool(self.timer.pin.value())  # some clones hold it high until they are fired again
        self.timer.arm(int(window_us / self.kind.scale) + 1)

    def fire(self) -> None:
        """Send the burst, and those of the sensors with the same trigger pin."""
        self.trigger.value(1)
        sleep_us(self.kind.trigger_us)
        self.trigger.value(0)

    def finish(self, window_us: int) -> int:
        """Return the flight, µs, or `NO_ECHO` inside the window, or `FAULT`."""
        pulse_us = self.timer.finish()
        if self._hangs or pulse_us == FAULT:
            return FAULT
        flight_us = int(pulse_us * self.kind.scale + 0.5)
        return flight_us if 0 < flight_us <= window_us else NO_ECHO
