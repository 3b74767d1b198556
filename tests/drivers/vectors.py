"""Frames of the ring-and-base protocol with their bytes, and bytes that are no frames, from the protocol itself."""

from __future__ import annotations

from typing import Literal, TypeAlias

from drivers.denning.frames import (
    Ack,
    Drive,
    Echo,
    Echo2,
    Frame,
    Halt,
    Hello,
    Ident,
    Listen,
    Nak,
    NakCode,
    Odom,
    Pattern,
    Release,
)

Side: TypeAlias = Literal["host", "robot"]

OCTETS = (0x249249, 0x492492, 0x924924)
THIRDS = tuple(0x010101 << k for k in range(8))

GOOD: tuple[tuple[Side, Frame, str], ...] = (
    ("host", Hello(0), "020104018deb00"),
    ("host", Pattern(1, 50, 255, OCTETS), "05020103320dff49922492244924499272ef00"),
    (
        "host",
        Pattern(2, 50, 255, THIRDS),
        "05020208321cff010101020202040404080808101010202020404040808080711200",
    ),
    ("host", Pattern(3, 50, 255, ()), "030203023204ffb7de00"),
    ("host", Drive(4, 305, -250), "091004310106ffa94400"),
    ("host", Drive(255, 0, 0), "0310ff010101033b4e00"),
    ("host", Halt(5), "051105e87d00"),
    ("host", Release(6), "051206d81800"),
    (
        "robot",
        Ident(0, 1, 24, 381, 500, 20, 0x1234ABCD, "denning"),
        "02810801187d01f401140ccdab341264656e6e696e67010101010101010103f26700",
    ),
    ("robot", Ack(1, 1), "06820101b6ba00"),
    ("robot", Nak(2, 2, NakCode.VALUE_OUT_OF_RANGE), "078302020345fa00"),
    (
        "robot",
        Odom(3, 1_000_000, 12345, -6789, 31416, 0, 305, -250, 0, 4),
        "06900340420f03393001077be5ffffb87a010101010105310106ff0404d14e00",
    ),
    (
        "robot",
        Odom(4, 2**32 - 1, -(2**31), 2**31 - 1, -62832, -62832, -1, 1, 31, 255),
        "079004ffffffff01011180ffffff7f900affff900affffffff01051fff399100",
    ),
    (
        "robot",
        Echo(5, 2_000_000, 0, 0x249249, (30, 255, 5, 254, 0, 100, 31, 29)),
        "06910580841e01084992241eff05fe06641f1d429b00",
    ),
    ("robot", Echo(6, 2_050_000, 1, 0x800000, (77,)), "069106d0471f02010105804d01b400"),
    (
        "robot",
        Echo(7, 5, 0, 0xFFFFFF, tuple(range(10, 34))),
        "049107050101011effffff0a0b0c0d0e0f101112131415161718191a1b1c1d1e1f20214c4f00",
    ),
    # Version 2.
    ("host", Hello(0, 2), "02010402eedb00"),
    ("host", Listen(1, (10, 20)), "050301020a0102140103a70b00"),
    ("host", Listen(2, ()), "03030203aef300"),
    (
        "robot",
        Ident(0, 2, 16, 120, 500, 20, 0x1234ABCD, "ring", 1000, 1),
        "02810402107804f4011409cdab341272696e67010101010101010101010106e80301cd7300",
    ),
    (
        "robot",
        Echo2(1, 3_000_000, 0, 4, 10, (1234, 1240, 65535)),
        "069201c0c62d01020401020a0109d204d804ffff9ba600",
    ),
    ("robot", Echo2(2, 3_050_000, 1, 8, 0, (0,)), "069202108a2e03010801010101010103ee4200"),
)

BAD: tuple[tuple[str, str], ...] = (
    ("crc off by one bit", "091004310106ffa84400"),
    ("stuffing runs past the end", "ff0102030400"),
    ("shorter than type, seq and crc", "0410040100"),
    ("longer than 128 bytes", "0291" + "01" * 140 + "03eaca00"),
    ("ECHO with fewer range bytes than bits in its mask", "0491090101010102ff01050a0bf00b00"),
    ("ECHO with a reserved range byte", "0491090101010102010104032b5800"),
    ("ODOM cut short, crc right", "0390010101010101010101010341c100"),
    ("unknown type, crc right", "087f01616263118200"),
    # Version 2.
    ("ECHO2 with fewer ranges than bits in both masks", "04920901010101020101020201026403550800"),
    ("ECHO2 in which a sensor fires and listens", "0492090101010102030102020102640264026403da6200"),
    (
        "IDENT of version 2 cut before its range unit",
        "06810902107804f40114020101010572696e67010101010101010101010103caea00",
    ),
)
