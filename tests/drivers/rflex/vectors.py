"""Frames of the rFLEX protocol as hexadecimal text, with what they mean."""

from __future__ import annotations

from types import MappingProxyType
from typing import Final

from drivers.rflex.codec import (
    BRAKE_RELEASE,
    BRAKE_SET,
    SET_DEFAULTS,
    STATUS_REQUEST,
    AxisReport,
    Frame,
    Input,
    Report,
    SonarReport,
    Status,
    input_request,
    report_request,
    set_direction,
    sonar_run,
)

COMMANDS: Final = MappingProxyType({
    "1B 02 02 00 22 08 00 01 86 A0 00 00 00 03 0C 1B 03": report_request(100_000, 3),
    "1B 02 02 00 22 08 00 00 00 00 00 00 00 00 28 1B 03": report_request(0, 0),
    "1B 02 05 00 00 04 00 01 86 A0 26 1B 03": input_request(100_000),
    "1B 02 05 04 00 04 00 00 00 00 05 1B 03": input_request(0),
    "1B 02 02 00 0A 00 08 1B 03": SET_DEFAULTS,
    "1B 02 02 00 0B 00 09 1B 03": BRAKE_SET,
    "1B 02 02 00 0C 00 0E 1B 03": BRAKE_RELEASE,
    "1B 02 01 00 01 00 00 1B 03": STATUS_REQUEST,
    "1B 02 03 00 00 00 03 1B 03": Frame(3, 0),
    "1B 02 04 04 00 0D 00 00 75 30 00 00 00 00 00 00 00 00 02 4A 1B 03": sonar_run(30_000, 0),
    "1B 02 04 04 00 0D 00 00 00 00 00 00 00 00 00 00 00 00 00 0D 1B 03": sonar_run(0, 0, on=False),
    "1B 02 02 00 07 0E 00 00 00 76 A1 00 00 C5 B7 00 00 75 30 01 EA 1B 03": set_direction(0, 30369, 50615, 30000),
    "1B 02 02 00 07 0E 01 00 00 45 07 00 01 86 A0 00 00 88 B8 00 5F 1B 03": set_direction(1, -17671, 100000, 35000),
})  # fmt: skip
T_US: Final = 123456
READINGS: Final = ((0, 1476), (16, 2952), (32, 32766), (48, 738), (64, 32766), (80, 1000))
REPORTS: Final[MappingProxyType[str, tuple[int, Report]]] = MappingProxyType({
    "1B 02 02 07 21 19 00 00 00 00 00 01 E2 40 00 00 01 8B 6E 00 00 76 A1 00 00 C5 B7 00 00 75 30 9A 1B 03":
        (7, AxisReport(T_US, 0, 101230, 30369, 50615, 30000)),
    "1B 02 02 08 21 19 00 00 00 00 00 01 E2 40 01 FF FF 75 F0 00 00 00 00 00 01 86 A0 00 00 88 B8 02 1B 03":
        (8, AxisReport(T_US, 1, -35344, 0, 100000, 35000)),
    "1B 02 04 09 02 1A 00 00 00 00 00 01 E2 40 00 05 C4 10 0B 88 20 7F FE 30 02 E2 40 7F FE 50 03 E8 EF 1B 03":
        (9, SonarReport(T_US, READINGS)),
    "1B 02 05 0A 01 07 00 01 E2 40 42 00 05 ED 1B 03": (10, Input(T_US, 0x42, 5)),
    "1B 02 01 0B 01 09 00 01 E2 40 00 00 09 06 00 AE 1B 03": (11, Status(T_US, 2310, 0)),
    "1B 02 03 0C 00 0D 00 01 E2 40 00 00 00 0A FF FF FF FB 01 AE 1B 03":
        (12, Frame(3, 0, bytes.fromhex("0001E2400000000AFFFFFFFB01"), 12)),
})  # fmt: skip
