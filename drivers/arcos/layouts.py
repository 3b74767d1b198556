"""The layouts of packets on the wire: their fields in order, and conversion by such a table."""

from __future__ import annotations

import struct
from types import MappingProxyType
from typing import Any, Final, TypeAlias

Layout: TypeAlias = tuple[tuple[str, str], ...]
"""Fields in the order on the wire; `z` is a string that ends with a zero byte, the others are codes of `struct`."""

SIP_START: Final[Layout] = (
    ("kind", "B"),
    ("x", "h"),
    ("y", "h"),
    ("heading", "h"),
    ("left", "h"),
    ("right", "h"),
    ("battery", "B"),
    ("stall_left", "B"),
    ("stall_right", "B"),
    ("control", "h"),
    ("flags", "H"),
    ("compass", "B"),
)
SIP_TAIL: Final[Layout] = (
    ("gripper", "B"),
    ("analog_port", "B"),
    ("analog", "B"),
    ("digital_in", "B"),
    ("digital_out", "B"),
    ("battery_10", "H"),
    ("charge", "B"),
    ("turn_10", "h"),
    ("fault_flags", "H"),
    ("lateral", "h"),
    ("temperature", "b"),
    ("charge_percent", "B"),
    ("controller_us", "I"),
    ("flags_3", "I"),
)
NAME: Final[Layout] = (("name", "z"), ("class_name", "z"), ("subclass", "z"))
CONFIG: Final[Layout] = (
    ("class_name", "z"),
    ("subclass", "z"),
    ("serial", "z"),
    ("four_motors", "B"),
    ("turn_top", "H"),
    ("speed_top", "H"),
    ("turn_acceleration_top", "H"),
    ("acceleration_top", "H"),
    ("pwm_max", "H"),
    ("name", "z"),
    ("sip_cycle_ms", "B"),
    ("host_baud", "B"),
    ("aux1_baud", "B"),
    ("gripper", "H"),
    ("front_sonar", "H"),
    ("rear_sonar", "B"),
    ("low_battery", "H"),
    ("rev_count", "H"),
    ("watchdog_ms", "H"),
    ("alternate_sip", "B"),
    ("stall_value", "H"),
    ("stall_count", "H"),
    ("joystick_speed", "H"),
    ("joystick_turn", "H"),
    ("turn_max", "H"),
    ("speed_max", "H"),
    ("turn_acceleration", "H"),
    ("turn_deceleration", "H"),
    ("turn_kp", "H"),
    ("turn_kv", "H"),
    ("turn_ki", "H"),
    ("acceleration", "H"),
    ("deceleration", "H"),
    ("speed_kp", "H"),
    ("speed_kv", "H"),
    ("speed_ki", "H"),
    ("front_bumpers", "B"),
    ("rear_bumpers", "B"),
    ("charger", "B"),
    ("sonar_cycle_ms", "B"),
    ("auto_baud", "B"),
    ("has_gyro", "B"),
    ("drift_factor", "h"),
    ("aux2_baud", "B"),
    ("aux3_baud", "B"),
    ("ticks_mm", "H"),
    ("shutdown_volts", "H"),
    ("firmware", "z"),
    ("gyro_cw", "H"),
    ("gyro_ccw", "H"),
    ("kinematics_delay_ms", "B"),
    ("lateral_top", "H"),
    ("lateral_acceleration_top", "H"),
    ("lateral_max", "H"),
    ("lateral_acceleration", "H"),
    ("lateral_deceleration", "H"),
    ("charge_threshold", "H"),
    ("pdb_port", "B"),
    ("gyro_rate_limit", "H"),
    ("high_temperature_shutdown", "b"),
    ("power_bits", "H"),
    ("battery_type", "B"),
    ("charge_low", "H"),
    ("charge_shutdown", "H"),
    ("bootloader", "z"),
    ("config_flags", "I"),
    ("gyro_firmware", "h"),
)
ENCODERS: Final[Layout] = (("left", "i"), ("right", "i"))
AXES: Final[Layout] = (("button_1", "B"), ("button_2", "B"), ("x", "H"), ("y", "H"), ("throttle", "H"))
_STRUCTS: Final = MappingProxyType({code: struct.Struct("<" + code) for code in "BbHhIi"})


def pack_integer(message: object, field: str, code: str, value: int) -> bytes:
    """Return the bytes of one integer.

    Raises
    ------
    ValueError
        It does not fit.
    """
    try:
        return _STRUCTS[code].pack(value)
    except struct.error as error:
        raise ValueError(f"{type(message).__name__}.{field} is {value!r}: {error}") from error


def pack(message: object, layout: Layout) -> bytes:
    """Return the bytes of the fields up to the first that is None.

    Raises
    ------
    ValueError
        A value does not fit its field.
    """
    out = bytearray()
    for field, code in layout:
        value = getattr(message, field)
        if value is None:
            break
        if code == "z":
            if "\0" in value:
                raise ValueError(f"{type(message).__name__}.{field} is {value!r}: it must not hold a zero")
            out += value.encode("latin-1", "replace") + b"\0"
        else:
            out += pack_integer(message, field, code, value)
    return bytes(out)


def unpack(layout: Layout, data: bytes) -> tuple[dict[str, Any], bytes]:
    """Return the fields that `data` holds as a whole, and the bytes after the last of them."""
    fields: dict[str, Any] = {}
    at = 0
    for field, code in layout:
        if code == "z":
            end = data.find(b"\0", at)
            if end < 0:
                break
            fields[field] = data[at:end].decode("latin-1")
            at = end + 1
        else:
            packer = _STRUCTS[code]
            if at + packer.size > len(data):
                break
            (fields[field],) = packer.unpack_from(data, at)
            at += packer.size
    return fields, data[at:]
