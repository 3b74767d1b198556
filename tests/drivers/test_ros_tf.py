"""Messages of frames against another implementation of the serialized form, rosbags'."""

from __future__ import annotations

import math
import struct
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_typestore

from drivers.ros_tf import Frame, decode, encode, planar

STORE = get_typestore(Stores.ROS2_JAZZY)
KIND = "tf2_msgs/msg/TFMessage"
NUMBERS = st.floats(-1e6, 1e6)
FRAMES = st.builds(
    Frame,
    st.integers(0, 2**31 * 1_000_000_000 - 1),
    st.text(max_size=9).filter(lambda text: "\x00" not in text),
    st.text(max_size=9).filter(lambda text: "\x00" not in text),
    st.tuples(NUMBERS, NUMBERS, NUMBERS),
    st.tuples(NUMBERS, NUMBERS, NUMBERS, NUMBERS),
)


def as_rows(message: Any) -> list[Frame]:
    rows = []
    for one in message.transforms:
        stamp, place, turn = one.header.stamp, one.transform.translation, one.transform.rotation
        rows.append(Frame(
            stamp.sec * 1_000_000_000 + stamp.nanosec, one.header.frame_id, one.child_frame_id,
            (place.x, place.y, place.z), (turn.x, turn.y, turn.z, turn.w),
        ))  # fmt: skip
    return rows


@settings(max_examples=25)
@given(st.lists(FRAMES, max_size=4))
def test_others_read_what_is_written_and_it_reads_what_others_write(frames: list[Frame]) -> None:
    message = STORE.deserialize_cdr(encode(frames), KIND)
    assert as_rows(message) == frames
    for little in (True, False):
        assert decode(bytes(STORE.serialize_cdr(message, KIND, little_endian=little))) == frames


@settings(max_examples=40)
@given(st.binary(max_size=80))
def test_any_bytes_are_refused_or_read(data: bytes) -> None:
    for message in (data, b"\x00\x01\x00\x00" + data, b"\x00\x01\x00\x00\x02\x00\x00\x00" + data):
        try:
            decode(message)
        except ValueError:
            continue


def test_a_count_that_cannot_be_true_is_refused() -> None:
    with pytest.raises(ValueError, match="4294967295 frames"):
        decode(b"\x00\x01\x00\x00" + struct.pack("<I", 2**32 - 1))


def test_a_planar_frame_turns_about_the_vertical() -> None:
    frame = planar(5, "a", "b", 1.0, 2.0, 0.5 * math.pi)
    assert frame.translation == (1.0, 2.0, 0.0)
    assert frame.rotation == pytest.approx((0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5)))
