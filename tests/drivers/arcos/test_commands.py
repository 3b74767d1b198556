"""The arguments of commands, as firmware reads what clients send."""

from __future__ import annotations

from drivers.arcos.codec import decode_command
from drivers.arcos.commands import Command, Raw


def test_an_argument_is_read_as_the_firmware_reads_it() -> None:
    assert Command(11).value == 0
    assert Command(11, b"\1\2").value == 0
    assert decode_command(b"\x0b\x1b\x96\0").value == -150
    assert decode_command(b"\x0b\x1b\0\0") == Command(11, Raw(b"\x1b\0\0"))
    assert decode_command(b"\x0b\x1b\0\0").value == 0
    assert decode_command(b"\x0b\x3b\x05").value == 5
    assert decode_command(b"\x0b\x1b\x05\0\0\0").value == -5
    assert decode_command(b"\x0b\x99\x05").value == 0


def test_two_packed_bytes_may_come_negated() -> None:
    packed, raw = decode_command(bytes.fromhex("201bf609")), decode_command(bytes.fromhex("203b0af6"))
    assert packed.two_bytes == raw.two_bytes == (0xF6, 0x0A)
