"""Conversion by a table of fields: whole fields only, and what is left over."""

from __future__ import annotations

from dataclasses import fields

import pytest

from drivers.arcos.frames import ConfigPacket, EncoderPacket, JoystickPacket, RobotName, Sip
from drivers.arcos.layouts import (
    AXES,
    CONFIG,
    ENCODERS,
    NAME,
    SIP_START,
    SIP_TAIL,
    Layout,
    pack,
    pack_integer,
    unpack,
)


@pytest.mark.parametrize(
    ("packet", "layout", "others"),
    [
        (Sip, SIP_START + SIP_TAIL, {"sonar", "missing"}),
        (ConfigPacket, CONFIG, set()),
        (RobotName, NAME, set()),
        (EncoderPacket, ENCODERS, set()),
        (JoystickPacket, AXES, set()),
    ],
)
def test_a_layout_names_the_fields_of_its_packet_in_order(packet: type, layout: Layout, others: set[str]) -> None:
    names = [field.name for field in fields(packet) if field.name not in others | {"extra"}]
    assert [name for name, _ in layout] == names


def test_a_field_counts_only_if_it_is_whole() -> None:
    assert unpack(NAME, b"ab\0c\0d") == ({"name": "ab", "class_name": "c"}, b"d")
    assert unpack(ENCODERS, b"\xff\xff\xff\xff\1\0\0") == ({"left": -1}, b"\1\0\0")
    assert unpack(NAME, b"") == ({}, b"")


def test_the_first_missing_field_ends_the_packet() -> None:
    assert pack(RobotName("a", None, "c"), NAME) == b"a\0"
    assert pack(RobotName("\u20ac\xe9"), NAME) == b"?\xe9\0"


def test_an_integer_that_does_not_fit_is_named() -> None:
    assert pack_integer(RobotName(), "x", "h", -2) == b"\xfe\xff"
    with pytest.raises(ValueError, match=r"RobotName\.x is 256: .*255"):
        pack_integer(RobotName(), "x", "B", 256)
