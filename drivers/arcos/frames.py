"""The packets that a robot of the Pioneer family sends, as typed values in the protocol's units.

Only this folder uses raw odometry counts, tenths of a volt and parts of a turn. Every type keeps what it needs to
be encoded again byte for byte: a packet that ends early has None for the fields it lacks, and `extra` holds the bytes
after the last field that is known.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntFlag
from typing import Final, TypeAlias

BAUDS: Final = (9600, 19200, 38400, 57600, 115200)
"""Line speeds by their code in HOSTBAUD and in the CONFIGpac."""
NO_ECHO_MM: Final = 5000
"""The range of a sensor that heard no echo, mm."""
SIP_STOPPED, SIP_MOVING = 0x32, 0x33
"""The packet types of a SIP at rest and in motion; firmware may use 0x30, 0x31 and 0x34 too."""


class SipFlags(IntFlag):
    """The bits of `Sip.flags`."""

    MOTORS_ENABLED = 1 << 0
    SONAR_1 = 1 << 1
    SONAR_2 = 1 << 2
    SONAR_3 = 1 << 3
    SONAR_4 = 1 << 4
    STOP_BUTTON = 1 << 5
    E_STALL = 1 << 6
    FAR_LEDGE = 1 << 7
    NEAR_LEDGE = 1 << 8
    JOYSTICK_BUTTON = 1 << 9
    POWER_GOOD = 1 << 10


@dataclass(frozen=True, slots=True)
class SyncEcho:
    """The answer to SYNC0 or SYNC1: the same frame."""

    number: int


@dataclass(frozen=True, slots=True)
class RobotName:
    """The answer to SYNC2: the robot's name, its class as `Pioneer`, and its subclass as `p3dx`; None if missing."""

    name: str | None = None
    class_name: str | None = None
    subclass: str | None = None
    extra: bytes = b""


@dataclass(frozen=True, slots=True)
class SonarReading:
    """One range: the sensor's number, counted from 0, and the raw range."""

    number: int
    range_raw: int


@dataclass(frozen=True, slots=True)
class Sip:
    """The server information packet, which the robot sends periodically: odometry, status and new ranges.

    The factors between raw values and SI differ between models.
    """

    kind: int
    """Packet type: at rest 0x32, in motion 0x33."""
    x: int
    y: int
    """Raw odometry, signed 16 bits as sent; firmware counts 15 of them."""
    heading: int
    """In units of 1/4096 turn, counter-clockwise."""
    left: int
    right: int
    """Raw speeds of the wheels."""
    battery: int
    """0.1 V."""
    stall_left: int
    stall_right: int
    """Bit 0: the wheel is stalled. Bits 1 to 7: segments 1 to 7 of the rear bumper (left) or front bumper (right)."""
    control: int
    """Set-point of the heading."""
    flags: int
    """Bits of `SipFlags`."""
    compass: int
    """2 degrees; 0 without a compass."""
    sonar: tuple[SonarReading, ...] = ()
    """Ranges measured since the last SIP, in the order of firing."""
    missing: int = 0
    """Number of ranges that the packet announces and does not hold; then `sonar` is empty."""
    gripper: int | None = None
    analog_port: int | None = None
    analog: int | None = None
    digital_in: int | None = None
    digital_out: int | None = None
    """Accessories, one byte each. P2OS ends here; each field from here on may be None, and then so are all after
    it."""
    battery_10: int | None = None
    """0.1 V, two bytes."""
    charge: int | None = None
    """Charger: 0 not charging, 1 bulk, 2 overcharge, 3 float, 4 balance."""
    turn_10: int | None = None
    """Turning rate, 0.1 degrees/s."""
    fault_flags: int | None = None
    lateral: int | None = None
    temperature: int | None = None
    charge_percent: int | None = None
    """Fault bits; lateral speed, mm/s; °C, -127 or -128 without a sensor; %."""
    controller_us: int | None = None
    flags_3: int | None = None
    """Only of some models: the controller's clock and more status bits."""
    extra: bytes = b""
    """Bytes after the last field."""


@dataclass(frozen=True, slots=True)
class ConfigPacket:
    """The CONFIGpac: the robot's names, limits and settings; a field that older firmware lacks is None.

    Units as in the protocol: mm/s, mm/s², degrees/s, degrees/s², ms, 0.1 V; baud rates as indices of `BAUDS`.
    """

    class_name: str | None = None
    subclass: str | None = None
    serial: str | None = None
    four_motors: int | None = None
    turn_top: int | None = None
    speed_top: int | None = None
    turn_acceleration_top: int | None = None
    acceleration_top: int | None = None
    pwm_max: int | None = None
    name: str | None = None
    sip_cycle_ms: int | None = None
    host_baud: int | None = None
    aux1_baud: int | None = None
    gripper: int | None = None
    front_sonar: int | None = None
    rear_sonar: int | None = None
    low_battery: int | None = None
    rev_count: int | None = None
    watchdog_ms: int | None = None
    alternate_sip: int | None = None
    stall_value: int | None = None
    stall_count: int | None = None
    joystick_speed: int | None = None
    joystick_turn: int | None = None
    turn_max: int | None = None
    speed_max: int | None = None
    turn_acceleration: int | None = None
    turn_deceleration: int | None = None
    turn_kp: int | None = None
    turn_kv: int | None = None
    turn_ki: int | None = None
    acceleration: int | None = None
    deceleration: int | None = None
    speed_kp: int | None = None
    speed_kv: int | None = None
    speed_ki: int | None = None
    front_bumpers: int | None = None
    rear_bumpers: int | None = None
    charger: int | None = None
    sonar_cycle_ms: int | None = None
    auto_baud: int | None = None
    has_gyro: int | None = None
    drift_factor: int | None = None
    aux2_baud: int | None = None
    aux3_baud: int | None = None
    ticks_mm: int | None = None
    shutdown_volts: int | None = None
    firmware: str | None = None
    gyro_cw: int | None = None
    gyro_ccw: int | None = None
    kinematics_delay_ms: int | None = None
    lateral_top: int | None = None
    lateral_acceleration_top: int | None = None
    lateral_max: int | None = None
    lateral_acceleration: int | None = None
    lateral_deceleration: int | None = None
    charge_threshold: int | None = None
    pdb_port: int | None = None
    gyro_rate_limit: int | None = None
    high_temperature_shutdown: int | None = None
    power_bits: int | None = None
    battery_type: int | None = None
    charge_low: int | None = None
    charge_shutdown: int | None = None
    bootloader: str | None = None
    config_flags: int | None = None
    gyro_firmware: int | None = None
    extra: bytes = b""


@dataclass(frozen=True, slots=True)
class EncoderPacket:
    """Counts of the wheels' encoders."""

    left: int
    right: int
    extra: bytes = b""


@dataclass(frozen=True, slots=True)
class GyroPacket:
    """Samples of the gyroscope since the last packet: rate, 512 at rest, and temperature, both raw."""

    samples: tuple[tuple[int, int], ...]
    extra: bytes = b""


@dataclass(frozen=True, slots=True)
class IoPacket:
    """Digital inputs and outputs, bytes of 8 bits, and analog inputs, raw."""

    digital_in: bytes
    digital_out: bytes
    analog: tuple[int, ...]
    extra: bytes = b""


@dataclass(frozen=True, slots=True)
class JoystickPacket:
    """The joystick: its buttons, and its axes from 0 to 1023 with 512 in the middle."""

    button_1: int
    button_2: int
    x: int
    y: int
    throttle: int
    extra: bytes = b""


@dataclass(frozen=True, slots=True)
class AuxPacket:
    """Bytes from an auxiliary serial port, 1 to 3."""

    port: int
    data: bytes


@dataclass(frozen=True, slots=True)
class BatteryPacket:
    """The answer to BATTERYINFO, whose layout depends on the batteries."""

    data: bytes


@dataclass(frozen=True, slots=True)
class ResetNotice:
    """The controller was reset and waits for a new SYNC0; `kind` is 0xFF, or 0xFE in its maintenance mode."""

    kind: int
    data: bytes = b""


@dataclass(frozen=True, slots=True)
class Other:
    """A packet of an unknown type, or one whose body does not have the layout of its type."""

    kind: int
    data: bytes


Packet: TypeAlias = (
    SyncEcho
    | RobotName
    | Sip
    | ConfigPacket
    | EncoderPacket
    | GyroPacket
    | IoPacket
    | JoystickPacket
    | AuxPacket
    | BatteryPacket
    | ResetNotice
    | Other
)
