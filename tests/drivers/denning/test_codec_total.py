"""P4: the decoder is total: millions of bytes of every kind of noise, and what a 16-bit checksum lets pass."""

from __future__ import annotations

import itertools
import math
import sys
import tracemalloc
from collections.abc import Callable

import numpy as np
import pytest
from cobs import cobs

from drivers.denning.codec import Decoder, crc, encode
from drivers.denning.frames import Ack, Frame, Halt, Odom
from tests.drivers.noise import blocks, framed
from tests.drivers.vectors import Side

pytestmark = [pytest.mark.compiled, pytest.mark.promise("P4")]

HELD_MAX = 1024
SIDES: tuple[Side, ...] = ("host", "robot")
CHUNKS = (1, 2, 3, 7, 16, 61, 256, 4096)
SLICE = 500_000
UNLIKELY = 1e-7
"""A count less likely than this, on either side, is no chance; the seeds are fixed, so it is met once or never."""
Measured = Callable[[str], None]


def poisson_tails(count: int, mean: float) -> tuple[float, float]:
    """Return how likely it is to count `count` or fewer, and `count` or more, where `mean` are expected."""
    terms = [math.exp(k * math.log(mean) - mean - math.lgamma(k + 1)) for k in range(count + 1)]
    return sum(terms), 1.0 - sum(terms[:-1])


def markers(side: Side) -> tuple[Frame, Frame]:
    return (Halt(1), Halt(2)) if side == "host" else (Ack(1, 1), Ack(2, 2))


def survive(side: Side, seed: int, total: int) -> tuple[int, int, int]:
    """Decode `total` bytes of noise, chunked and whole; return frames, bad frames, and the most bytes held."""
    rng = np.random.default_rng(seed + 1)
    chunked, whole = Decoder(side), Decoder(side)
    two = markers(side)
    call = b"".join(map(encode, two))
    held = 0
    for block in blocks(side, seed, total):
        size = CHUNKS[rng.integers(0, len(CHUNKS))]
        found: list[Frame] = []
        for start in range(0, len(block), size):
            found += chunked.feed(block[start : start + size])
            if chunked.pending > held:
                held = chunked.pending
        held = max(held, sys.getsizeof(chunked._pending))
        assert found == whole.feed(block)
        assert (chunked.frames, chunked.bad, chunked.lost) == (whole.frames, whole.bad, whole.lost)
        assert chunked.take_rejected() == whole.take_rejected()
        # Whatever the block left behind, the first frame after it may suffer; the second does not.
        after = chunked.feed(call)
        assert after[-1:] == [two[1]], "in step again"
        assert after == whole.feed(call)
        assert chunked.pending == 0
    assert held <= HELD_MAX
    return chunked.frames, chunked.bad, held


def check_noise(side: Side, seed: int, total: int) -> str:
    frames, bad, held = survive(side, seed, total)
    assert frames > 0.002 * total
    assert bad > 0.002 * total
    return f"{total:.0e} bytes from the {side}: {frames:,} frames, {bad:,} dropped, ≤ {held} bytes held"


@pytest.mark.parametrize("side", SIDES)
def test_noise_of_every_kind_is_survived(side: Side, measured: Measured) -> None:
    measured(check_noise(side, 40, 300_000))


@pytest.mark.soak
@pytest.mark.parametrize("side", SIDES)
def test_a_thousand_million_bytes(side: Side, measured: Measured) -> None:
    measured(check_noise(side, 41, 500_000_000))


def test_memory_does_not_grow_with_what_no_one_takes() -> None:
    """Refusals that no one asks for, and a frame that never ends, hold a few kilobytes and no more."""
    decoder = Decoder("host")
    noise = b"".join(framed(bytes((0x7F, seq))) for seq in range(256)) + b"\xff" * 5000
    decoder.feed(noise)
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        for _ in range(50):
            decoder.feed(noise)
        assert tracemalloc.get_traced_memory()[0] - before < 16 * 1024
    finally:
        tracemalloc.stop()


def passes(decoder: Decoder, body: bytes) -> bool:
    """Say whether a body, its checksum at its end, is taken for one that arrived well."""
    before = decoder.frames
    decoder.feed(cobs.encode(body) + b"\0")
    return decoder.frames > before or bool(decoder.take_rejected())


def count_false(corrupt: int, seed: int, count: int) -> int:
    """Spoil `count` odometry frames by overwriting `corrupt` bytes in a row, and count those that still pass."""
    rng, slices = np.random.default_rng(seed), -(-count // SLICE)
    if slices > 1:  # in slices that fit into any memory
        seeds = np.random.SeedSequence(seed).generate_state(slices).tolist()
        return sum(count_false(corrupt, one, min(SLICE, count - k * SLICE)) for k, one in enumerate(seeds))
    values = rng.integers(-(2**15), 2**15, (256, 6)).tolist()
    good = [Odom(k, 1000 * k, x, y, a, b, v, w, 0, 0) for k, (x, y, a, b, v, w) in enumerate(values)]
    bodies = [cobs.decode(encode(odom)[:-1]) for odom in good]
    starts = rng.integers(0, len(bodies[0]) - corrupt + 1, count).tolist()
    noise = rng.bytes(count * corrupt)
    decoder, false = Decoder("robot"), 0
    for i, start in enumerate(starts):
        body = bodies[i % 256]
        burst = noise[i * corrupt : (i + 1) * corrupt]
        spoilt = body[:start] + burst + body[start + corrupt :]
        if spoilt != body:
            false += passes(decoder, spoilt)
    return false


def check_false(corrupt: int, seed: int, count: int) -> str:
    """Any error longer than the checksum passes with a chance of 2⁻¹⁶: so many pass that a Poisson count explains."""
    false, expected = count_false(corrupt, seed, count), count / 65536
    assert min(poisson_tails(false, expected)) > UNLIKELY, (false, expected)
    return f"{count:,} frames with {corrupt} bytes overwritten: {false} pass, CRC-16 predicts {expected:.1f}"


@pytest.mark.parametrize("corrupt", [8, 20])
def test_false_accepts_are_as_many_as_the_checksum_predicts(corrupt: int, measured: Measured) -> None:
    measured(check_false(corrupt, 42, 65_536))


@pytest.mark.soak
def test_false_accepts_are_as_many_as_the_checksum_predicts_in_the_long_run(measured: Measured) -> None:
    measured(check_false(20, 43, 100_000_000))


def test_what_the_checksum_always_catches_is_always_caught(measured: Measured) -> None:
    """One, two and three flipped bits anywhere, and every burst of up to 16 bits: CRC-16 lets none of them pass."""
    body = cobs.decode(encode(Odom(3, 1_000_000, 12345, -6789, 31416, 0, 305, -250, 0, 4))[:-1])
    bits, number = 8 * len(body), int.from_bytes(body, "big")
    rng = np.random.default_rng(44)
    errors = {1 << i for i in range(bits)}
    errors |= {1 << i | 1 << j for i, j in itertools.combinations(range(bits), 2)}
    errors |= {sum(1 << int(i) for i in rng.choice(bits, 3, replace=False)) for _ in range(3_000)}
    bursts, places = rng.integers(1, 2**16, 3_000).tolist(), rng.integers(0, bits - 16, 3_000).tolist()
    errors |= {burst << place for burst, place in zip(bursts, places, strict=True)}
    decoder = Decoder("robot")
    assert passes(decoder, body)
    assert not any(passes(decoder, (number ^ error).to_bytes(len(body), "big")) for error in errors)
    measured(f"{len(errors):,} errors of up to 3 bits or bursts of up to 16: 0 pass")


def test_noise_alone_makes_no_more_frames_than_the_checksum_lets_pass(measured: Measured) -> None:
    total = 2_000_000
    rng = np.random.default_rng(45)
    decoder, pieces = Decoder("robot"), 0
    for _ in range(total // 100_000):
        noise = rng.bytes(100_000)
        pieces += noise.count(0)
        decoder.feed(noise)
    accepted = decoder.frames + len(decoder.rejected)
    expected = pieces / 65536
    assert poisson_tails(accepted, expected)[1] > UNLIKELY, (accepted, expected)
    measured(f"{total:.0e} random bytes: {accepted} accepted, CRC-16 predicts at most {expected:.1f}")


def test_the_bound_is_one() -> None:
    assert poisson_tails(0, 1.0) == pytest.approx((math.exp(-1.0), 1.0))
    assert poisson_tails(2, 1.0) == pytest.approx((2.5 * math.exp(-1.0), 1.0 - 2.0 * math.exp(-1.0)))
    assert min(poisson_tails(60, 15.0)) < UNLIKELY
    assert min(poisson_tails(0, 30.0)) < UNLIKELY
    assert crc(b"123456789") == 0x29B1, "the checksum's own check value"
