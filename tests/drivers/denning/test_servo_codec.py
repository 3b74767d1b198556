"""Frames of rings with servos that cannot be: refused before they are sent, and named when they are received."""

from __future__ import annotations

import pytest

from drivers.denning.frames import Echo3, NakCode, Scan, Sweep
from drivers.denning.servo_codec import decode_echo3_tail, decode_scan_tail, encode_servo_tail

SWEEP = Sweep(0, -100, 10, 20, 0)


@pytest.mark.parametrize(
    ("frame", "text"),
    [
        (Scan(0, ()), "Scan: 0 sweeps, expected 1 to 12"),
        (Scan(0, (SWEEP._replace(first=40_000),)), "Scan: "),
        (Echo3(0, 0, 0, 1, 2, (9,), (9,)), "Echo3: masks of"),
        (Echo3(0, 0, 0, 3, 2, (9,), (9,)), r"Echo3: masks of \(2, 1\) bits, 1 counts, 1 bearings"),
        (Echo3(0, 0, 0, 1 << 24, 0, (9,), ()), "Echo3: "),
    ],
)
def test_a_value_that_does_not_fit_is_named(frame: Scan | Echo3, text: str) -> None:
    with pytest.raises(ValueError, match=text):
        encode_servo_tail(frame)


def test_what_was_encoded_is_decoded() -> None:
    assert decode_scan_tail(encode_servo_tail(Scan(0, (SWEEP, SWEEP)))) == ((SWEEP, SWEEP),)
    echo = Echo3(0, 0, 0, 0b101, 0b100, (7, 8), (-31_000,))
    assert decode_echo3_tail(encode_servo_tail(echo)) == (0b101, 0b100, (7, 8), (-31_000,))


def test_malformed_payloads_are_refused_with_their_code() -> None:
    assert decode_scan_tail(b"") == decode_scan_tail(b"\1\0") == NakCode.WRONG_LENGTH
    assert decode_scan_tail(b"\0") == NakCode.VALUE_OUT_OF_RANGE
    assert decode_echo3_tail(b"\1\0\0") == decode_echo3_tail(b"\1\0\0\0\0\0\1") == NakCode.WRONG_LENGTH
    assert decode_echo3_tail(b"\1\0\0\2\0\0\1\1\1\1") == NakCode.VALUE_OUT_OF_RANGE
