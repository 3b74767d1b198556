"""The RP2040's module `rp2`: state machines that time pulses as `ring/pio.py` programs them to."""

from board import BOARD

OVER = 0xFFFFFFFF


class PIO:
    JOIN_NONE = 0


def asm_pio(**_settings):
    return lambda program: program


class StateMachine:
    """Behaves as the program does; the program itself is run in tests/drivers/firmware/test_pio.py."""

    def __init__(self, number: int, program, freq: int, in_base, jmp_pin) -> None:
        BOARD.machines[in_base.number] = self
        self._tx, self._rx = [], []
        self._on = False
        self._rise = None

    def active(self, on: int) -> None:
        self._on = bool(on)

    def restart(self) -> None:
        self._rise = None
        self._tx.clear()

    def put(self, value: int) -> None:
        self._tx.append(value)

    def rx_fifo(self) -> int:
        if self._rise is not None and BOARD.now - self._rise > self._tx[0]:
            self._finish(OVER)
        return len(self._rx)

    def get(self) -> int:
        return self._rx.pop(0)

    def edge(self, level: int, now: int) -> None:
        if not self._on or not self._tx:
            return
        if level:
            self._rise = now
        elif self._rise is not None:
            left = self._tx[0] - (now - self._rise)
            self._finish(left if left >= 0 else OVER)

    def _finish(self, left: int) -> None:
        self._rx.append(left)
        self._rise = None
        self._tx.clear()
