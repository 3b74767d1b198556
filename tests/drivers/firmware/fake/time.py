"""The board's time: virtual, or the machine's own; it wraps as on a board."""

from board import BOARD

_WRAP = 1 << 30


def ticks_us() -> int:
    return BOARD.read_clock() % _WRAP


def ticks_add(ticks: int, delta: int) -> int:
    return (ticks + delta) % _WRAP


def ticks_diff(later: int, earlier: int) -> int:
    return (later - earlier + _WRAP // 2) % _WRAP - _WRAP // 2


def sleep_us(us: int) -> None:
    BOARD.advance(us)
