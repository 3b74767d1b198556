"""The board's module `machine`, as far as the firmware uses it."""

from board import BOARD


class Pin:
    IN, OUT = 0, 1
    PULL_UP, PULL_DOWN = 1, 2
    IRQ_RISING, IRQ_FALLING = 1, 2

    def __init__(self, number: int, mode: int = -1, pull: int = -1, value=None) -> None:
        self.number = number
        if pull == Pin.PULL_UP:
            BOARD.levels[number] = 1
        if value is not None:
            self.value(value)

    def value(self, level=None):
        if level is None:
            return BOARD.levels[self.number]
        return BOARD.set_output(self.number, int(level))

    def irq(self, handler, trigger: int, hard: bool = False) -> None:
        BOARD.handlers[self.number] = handler, trigger, self


class PWM:
    def __init__(self, pin: Pin, freq: int = 0, duty_u16: int = 0) -> None:
        self._pin = pin.number
        self.duty_u16(duty_u16)

    def duty_u16(self, duty: int) -> None:
        if not 0 <= duty <= 65535:
            raise ValueError(duty)
        BOARD.duties[self._pin] = duty


class ADC:
    reading = 65535

    def __init__(self, pin: Pin) -> None:
        pass

    def read_u16(self) -> int:
        if ADC.reading < 0:
            raise OSError(5)
        return ADC.reading


class Timer:
    PERIODIC = 1

    def __init__(self, number: int) -> None:
        self._on = False

    def init(self, period: int, mode: int, callback) -> None:
        self._on, self._period_us, self._callback = True, 1000 * period, callback
        BOARD.at(BOARD.now + self._period_us, self._fire)

    def deinit(self) -> None:
        self._on = False

    def _fire(self, _argument) -> None:
        if self._on:
            BOARD.at(BOARD.now + self._period_us, self._fire)
            self._callback(self)


class I2C:
    """SRF08s: busy for as long as their range register says; a dead one does not answer."""

    def __init__(self, number: int, sda: Pin, scl: Pin, freq: int) -> None:
        self._range, self._done, self._echo = {}, {}, {}

    def _sensor(self, address: int) -> int:
        BOARD.advance(300)
        sensor = BOARD.i2c.get(address, -1)
        if sensor < 0 or BOARD.states[sensor]:
            raise OSError(19)
        return sensor

    def writeto_mem(self, address: int, register: int, data) -> None:
        sensor = self._sensor(address)
        if BOARD.now < self._done.get(address, 0):
            raise OSError(5)
        if register == 2:
            self._range[address] = data[0]
        elif data[0] == 0x52:
            width = BOARD.next_width(sensor)
            longest = (self._range.get(address, 255) + 1) * 43_000 * 2 // 343
            self._echo[address] = 0 if width > longest else width
            self._done[address] = BOARD.now + longest

    def readfrom_mem_into(self, address: int, register: int, data) -> None:
        self._sensor(address)
        busy = BOARD.now < self._done.get(address, 0)
        echo = self._echo.get(address, 0)
        values = (0xFF, 0xFF) if busy else (10, 0) if register == 0 else (echo >> 8, echo & 0xFF)
        for k in range(len(data)):
            data[k] = values[k]


class UART:
    """A line whose other end is the test."""

    received = bytearray()
    sent = bytearray()

    def __init__(self, number: int, **settings) -> None:
        pass

    def any(self) -> int:
        return len(UART.received)

    def readinto(self, data) -> int:
        data[0] = UART.received[0]
        UART.received = UART.received[1:]
        return 1

    def write(self, data) -> None:
        UART.sent.extend(data)


def idle() -> None:
    BOARD.advance(BOARD.idle_us)


def reset() -> None:
    raise SystemExit(3)
