"""Bytes as a bad line delivers them: valid frames, corrupt frames, frames with invalid content, and noise."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from cobs import cobs

from drivers.denning.codec import crc, encode
from tests.drivers.vectors import GOOD, Side

KINDS = ("clean", "flipped", "cut", "noise", "small", "long", "nonsense")
TYPES = (0x01, 0x02, 0x03, 0x10, 0x11, 0x12, 0x81, 0x82, 0x83, 0x90, 0x91, 0x92, 0x7F)
BLOCK_MIN, BLOCK_MAX = 4.0, 32_768.0


def framed(body: bytes) -> bytes:
    """Return a whole frame around `body`, with the right checksum."""
    stuffed: bytes = cobs.encode(body + crc(body).to_bytes(2, "little"))
    return stuffed + b"\0"


def blocks(side: Side, seed: int, total: int) -> Iterator[bytes]:
    """Yield blocks of very different lengths and kinds, `total` bytes or a little more."""
    rng = np.random.default_rng(seed)
    good = [encode(frame) for which, frame, _ in GOOD if which == side]
    frames = np.frombuffer(b"".join(good[i] for i in rng.integers(0, len(good), 4096)), np.uint8)
    sent = 0
    while sent < total:
        length = round(float(np.exp(rng.uniform(np.log(BLOCK_MIN), np.log(BLOCK_MAX)))))
        start = int(rng.integers(0, len(frames) - length))
        block = _spoilt(KINDS[rng.integers(0, len(KINDS))], frames[start : start + length], rng)
        sent += len(block)
        yield block


def _spoilt(kind: str, block: np.ndarray[tuple[int, ...], np.dtype[np.uint8]], rng: np.random.Generator) -> bytes:
    """Return a block of valid frames, changed by this kind of noise."""
    length = len(block)
    match kind:
        case "flipped":
            flips = rng.random(8 * length) < rng.choice([1e-4, 1e-3, 1e-2])
            return (block ^ np.packbits(flips)).tobytes()
        case "cut":
            kept = block[rng.random(length) > 0.003]
            return np.insert(kept, rng.integers(0, len(kept) + 1, 1 + length // 500), rng.integers(0, 256)).tobytes()
        case "noise":
            return rng.bytes(length)
        case "small":
            return rng.choice(np.array([0, 1, 2, 3, 255], np.uint8), length).tobytes()
        case "long":
            return rng.integers(1, 256, length, np.uint8).tobytes()
        case "nonsense":
            out = bytearray()
            while len(out) < length:
                head = bytes((TYPES[rng.integers(0, len(TYPES))], rng.integers(0, 256)))
                out += framed(head + rng.bytes(int(rng.integers(0, 60))))
            return bytes(out)
        case _:
            return block.tobytes()
