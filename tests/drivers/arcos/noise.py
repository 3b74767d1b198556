"""Bytes as a bad line delivers them to either end: whole, flipped, cut and made-up frames, and noise."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal, TypeAlias

import numpy as np

from drivers.arcos.codec import frame
from tests.drivers.arcos.vectors import COMMANDS, PACKETS

Side: TypeAlias = Literal["host", "robot"]
KINDS = ("whole", "flipped", "cut", "noise", "headers", "made up")
BLOCK_MIN, BLOCK_MAX = 4.0, 8_192.0


def blocks(side: Side, seed: int, total: int) -> Iterator[bytes]:
    """Yield blocks of very different lengths and kinds, `total` bytes or a little more."""
    rng = np.random.default_rng(seed)
    good = [bytes.fromhex(wire) for _, wire in (COMMANDS if side == "host" else PACKETS)]
    sent = 0
    while sent < total:
        length = round(float(np.exp(rng.uniform(np.log(BLOCK_MIN), np.log(BLOCK_MAX)))))
        block = _block(KINDS[rng.integers(0, len(KINDS))], good, length, rng)
        sent += len(block)
        yield block


def _block(kind: str, good: list[bytes], length: int, rng: np.random.Generator) -> bytes:
    """Return about `length` bytes of this kind."""
    if kind == "noise":
        return rng.bytes(length)
    if kind == "headers":
        return rng.choice(np.array([0xFA, 0xFB, 3, 6, 0xFF, 0], np.uint8), length).tobytes()
    out = bytearray()
    while len(out) < length:
        made_up = kind == "made up"
        out += frame(rng.bytes(int(rng.integers(1, 254)))) if made_up else good[rng.integers(0, len(good))]
    whole = np.frombuffer(bytes(out), np.uint8)
    if kind == "flipped":
        flips = rng.random(8 * len(whole)) < rng.choice([1e-4, 1e-3, 1e-2])
        return (whole ^ np.packbits(flips)).tobytes()
    if kind == "cut":
        return whole[rng.random(len(whole)) > 0.003].tobytes()
    return bytes(out)
