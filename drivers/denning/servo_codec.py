"""The layout of the frames of rings with servos, behind their fixed fields: SCAN and ECHO3."""

from __future__ import annotations

import struct
from typing import Final

from drivers.denning.frames import SWEEPS_MAX, Echo3, NakCode, Scan, Sweep

_SWEEP: Final = struct.Struct("<BhhBB")
_MASK_BYTES: Final = 3


def encode_servo_tail(frame: Scan | Echo3) -> bytes:
    """Return the bytes of a frame after its fixed fields.

    Raises
    ------
    ValueError
        A value does not fit; the message names the frame.
    """
    try:
        return _scan_tail(frame) if isinstance(frame, Scan) else _echo3_tail(frame)
    except (ValueError, struct.error, OverflowError) as error:
        raise ValueError(f"{type(frame).__name__}: {error}") from error


def _scan_tail(frame: Scan) -> bytes:
    """Return the bytes of a SCAN after its fixed ones.

    Raises
    ------
    ValueError
        It has too many sweeps, or none.
    """
    if not 1 <= len(frame.sweeps) <= SWEEPS_MAX:
        raise ValueError(f"{len(frame.sweeps)} sweeps, expected 1 to {SWEEPS_MAX}")
    return bytes((len(frame.sweeps),)) + b"".join(_SWEEP.pack(*sweep) for sweep in frame.sweeps)


def _echo3_tail(frame: Echo3) -> bytes:
    """Return the bytes of an ECHO3 after its fixed ones.

    Raises
    ------
    ValueError
        Masks, counts and bearings do not fit each other.
    """
    sizes = frame.fired.bit_count(), frame.turned.bit_count()
    if frame.turned & ~frame.fired or (len(frame.counts), len(frame.bearings)) != sizes:
        raise ValueError(f"masks of {sizes} bits, {len(frame.counts)} counts, {len(frame.bearings)} bearings")
    masks = b"".join(mask.to_bytes(_MASK_BYTES, "little") for mask in (frame.fired, frame.turned))
    return masks + struct.pack(f"<{sizes[0]}H{sizes[1]}h", *frame.counts, *frame.bearings)


def decode_scan_tail(tail: bytes) -> tuple[tuple[Sweep, ...]] | NakCode:
    """Return the sweeps of a SCAN, or the reason why they are invalid."""
    if not tail or len(tail) != 1 + _SWEEP.size * tail[0]:
        return NakCode.WRONG_LENGTH
    if not 1 <= tail[0] <= SWEEPS_MAX:
        return NakCode.VALUE_OUT_OF_RANGE
    return (tuple(Sweep(*values) for values in _SWEEP.iter_unpack(tail[1:])),)


def decode_echo3_tail(tail: bytes) -> tuple[object, ...] | NakCode:
    """Return the masks, counts and bearings of an ECHO3, or the reason why they are invalid."""
    if len(tail) < 2 * _MASK_BYTES:
        return NakCode.WRONG_LENGTH
    fired, turned = (int.from_bytes(tail[k : k + _MASK_BYTES], "little") for k in (0, _MASK_BYTES))
    count, more = fired.bit_count(), turned.bit_count()
    if len(tail) != 2 * (_MASK_BYTES + count + more):
        return NakCode.WRONG_LENGTH
    if turned & ~fired:
        return NakCode.VALUE_OUT_OF_RANGE
    values = struct.unpack_from(f"<{count}H{more}h", tail, 2 * _MASK_BYTES)
    return fired, turned, values[:count], values[count:]
