"""Seeded mutation of valid files: flipped bytes, swapped lines, extreme numbers, misplaced words."""

from __future__ import annotations

import random
import re
from collections.abc import Callable, Sequence

Mutator = Callable[[random.Random, bytes], bytes]

NUMBER = re.compile(rb"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
EXTREMES = (
    b"0", b"-0.0", b"-1", b"1", b"2", b"254", b"255", b"256", b"65536", b"1e-320", b"1e-9", b"1e6", b"1e15", b"1e308",
    b"-1e308", b"1e999", b"inf", b"-inf", b"nan", b"9223372036854775807", b"9223372036854775808", b"0x7f", b"1_000",
    b"9" * 400, b"0." + b"3" * 400, b"true", b'""', b'"x"', b"[]", b"{}", b"1979-05-27", b"",
)  # fmt: skip
WORDS = (
    b"[", b"]", b"[[", b"]]", b"{", b"}", b"=", b".", b",", b'"', b"'", b'"""', b"#", b"\\", b"\n", b"\r", b"\r\n",
    b"\0", b"\xff", b"\xef\xbb\xbf", b"\xed\xa0\x80", "é".encode(), "\u202e".encode(), b"\x1b[31m", b";", b"\t",
    b"ring", b"ring.firing", b"[ring]", b"sensors", b"sets = [[0], [300]]\n", b"rotations = 255\n", b"preset",
    b"vertices_m", b"closed", b"[[drum]]", b"[[polygon]]", b"[acoustics]", b"model", b"models", b"robot", b"world",
    b"t,x,y,theta,r00\n", b"r00", b"ring_yaw", b"inf", b"nan",
)  # fmt: skip


def _slice(rng: random.Random, data: bytes, longest: int = 64) -> tuple[int, int]:
    begin = rng.randrange(len(data) + 1)
    return begin, min(len(data), begin + rng.randint(1, longest))


def flip(rng: random.Random, data: bytes) -> bytes:
    if not data:
        return data
    mutated = bytearray(data)
    mutated[rng.randrange(len(data))] = rng.randrange(256)
    return bytes(mutated)


def insert(rng: random.Random, data: bytes) -> bytes:
    at = rng.randrange(len(data) + 1)
    return data[:at] + rng.choice(WORDS) * rng.choice((1, 1, 1, 2, 40)) + data[at:]


def remove(rng: random.Random, data: bytes) -> bytes:
    begin, end = _slice(rng, data)
    return data[:begin] + data[end:]


def repeat(rng: random.Random, data: bytes) -> bytes:
    begin, end = _slice(rng, data, 200)
    return data[:end] + data[begin:end] * rng.choice((1, 2, 50)) + data[end:]


def extreme(rng: random.Random, data: bytes) -> bytes:
    found = list(NUMBER.finditer(data))
    if not found:
        return data
    number = rng.choice(found)
    return data[: number.start()] + rng.choice(EXTREMES) + data[number.end() :]


def swap_lines(rng: random.Random, data: bytes) -> bytes:
    lines = data.split(b"\n")
    i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
    lines[i], lines[j] = lines[j], lines[i]
    return b"\n".join(lines)


def truncate(rng: random.Random, data: bytes) -> bytes:
    return data[: rng.randrange(len(data) + 1)]


MUTATORS: tuple[Mutator, ...] = (flip, insert, remove, repeat, extreme, extreme, extreme, swap_lines, truncate)


def mutate(rng: random.Random, seeds: Sequence[bytes]) -> bytes:
    """Return one of `seeds` with one to four mutations; one in ten also gets the end of another seed."""
    data = rng.choice(seeds)
    if rng.random() < 0.1:
        data = truncate(rng, data) + rng.choice(seeds)[-rng.randint(1, 400) :]
    for _ in range(rng.choice((1, 1, 2, 4))):
        data = rng.choice(MUTATORS)(rng, data)
    return data[: 1 << 21]
