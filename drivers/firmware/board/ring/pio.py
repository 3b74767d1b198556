"""Times echo pulses in the RP2040's state machines, to a microsecond and without the processor."""

import rp2
from machine import Pin
from micropython import const
from rp2 import PIO, asm_pio

from ring.pulse_sensors import FAULT, NO_ECHO

MACHINES = 8
"""State machines of the RP2040: as many different echo pins can be timed."""
_FREQ = const(2_000_000)
"""Two cycles for each count, so a count is a microsecond."""
_OVER = const(0xFFFFFFFF)


@asm_pio(fifo_join=PIO.JOIN_NONE)
def _pulse() -> None:
    """Count down from the number given while the pin is high, and push what is left."""
    pull(block)
    mov(x, osr)
    wait(1, pin, 0)
    label("high")
    jmp(pin, "more")
    jmp("low")
    label("more")
    jmp(x_dec, "high")
    label("low")
    mov(isr, x)
    push(noblock)


class PioTimer:
    """Times the pulse on a pin; a counterpart of `irq.IrqTimer`."""

    def __init__(self, machine: int, number: int) -> None:
        if machine >= MACHINES:
            raise ValueError("robot_config.SENSORS: more than 8 echo pins; let sensors share them, or use interrupts")
        self.pin = Pin(number, Pin.IN, Pin.PULL_DOWN)
        self._machine = rp2.StateMachine(machine, _pulse, freq=_FREQ, in_base=self.pin, jmp_pin=self.pin)
        self._longest_us = 0

    def arm(self, longest_us: int) -> None:
        """Time the next pulse, up to `longest_us`."""
        machine = self._machine
        machine.active(0)
        machine.restart()
        while machine.rx_fifo():
            machine.get()
        self._longest_us = longest_us
        machine.put(longest_us)
        machine.active(1)

    def finish(self) -> int:
        """Return the pulse's length, `NO_ECHO` if it has not ended, `FAULT` if none began; the time is up."""
        machine = self._machine
        if machine.rx_fifo():
            left = machine.get()
            return NO_ECHO if left == _OVER else self._longest_us - left
        return NO_ECHO if self.pin.value() else FAULT
