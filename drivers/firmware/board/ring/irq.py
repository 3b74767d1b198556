"""Times echo pulses by interrupts; `hard` ones, where the board has them, are on time."""

from machine import Pin

from ring.clock import ticks_diff, ticks_us
from ring.pulse_sensors import FAULT, NO_ECHO


class IrqTimer:
    """Times the pulse on a pin; a counterpart of `pio.PioTimer`.

    Pulses that begin or end together call for one interrupt each, one after the other. So the first looks at the pins
    of all timers in `group`, which are those of the ring, and the others find nothing left to do.
    """

    def __init__(self, group: list, number: int) -> None:
        self.pin = Pin(number, Pin.IN)
        self._group = group
        self._rise_us = self._fall_us = 0
        self._edges = 2
        group.append(self)
        edges = Pin.IRQ_RISING | Pin.IRQ_FALLING
        try:
            self.pin.irq(self._edge, edges, hard=True)
        except (TypeError, ValueError):  # the ESP32 has none
            self.pin.irq(self._edge, edges)

    def _edge(self, _pin: Pin) -> None:
        """Note the time of an edge, at the pins of the group whose level it changed; an interrupt calls it."""
        now = ticks_us()
        for timer in self._group:
            if timer._edges != 2 and timer.pin.value() != timer._edges:
                if timer._edges == 0:
                    timer._rise_us = now
                else:
                    timer._fall_us = now
                timer._edges += 1

    def arm(self, _longest_us: int) -> None:
        """Time the next pulse."""
        self._edges = 0

    def finish(self) -> int:
        """Return the pulse's length, `NO_ECHO` if it has not ended, `FAULT` if none began; the time is up."""
        edges, self._edges = self._edges, 2
        if edges == 2:
            return ticks_diff(self._fall_us, self._rise_us)
        return NO_ECHO if edges == 1 else FAULT
