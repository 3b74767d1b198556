"""The fault script: the kinds of faults of the robot and its line, and a reader for the file that schedules them.

```toml
[[fault]]
at_s = 3.0
kind = "mute"
duration_s = 0.5
```
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, TypeAlias

from pydantic import Field, ValidationError
from pydantic_core import ErrorDetails

from config.files import ConfigError, dotted, one_line, parse_document, read_file
from config.problems import shown as shown_value
from config.strict import Strict, TomlList


class _Timed(Strict):
    at_s: float = Field(ge=0.0)
    """Seconds after the emulator's start."""
    duration_s: float = Field(default=0.0, ge=0.0)


class Mute(_Timed):
    """The robot sends nothing."""

    kind: Literal["mute"]


class Deaf(_Timed):
    """The robot reads nothing."""

    kind: Literal["deaf"]


class Garbage(_Timed):
    """Random bytes on the line between the robot's frames."""

    kind: Literal["garbage"]
    bytes_per_s: float = Field(default=2000.0, gt=0.0, le=1e6)


class BitErrors(_Timed):
    """Bits flip on the line, in both directions."""

    kind: Literal["bit_errors"]
    rate: float = Field(default=1e-3, gt=0.0, le=1.0)
    """Probability for each bit."""


class Reboot(_Timed):
    """The robot restarts, and is off for `duration_s`."""

    kind: Literal["reboot"]


class Bumper(_Timed):
    """The bumper is pressed, and held for `duration_s`."""

    kind: Literal["bumper"]


class MotorFault(_Timed):
    """A motor fails, and cannot be released for `duration_s`."""

    kind: Literal["motor_fault"]


class StopButton(_Timed):
    """The emergency stop is pressed, and held for `duration_s`: the base stops and cannot be released meanwhile."""

    kind: Literal["stop_button"]


class LowBattery(_Timed):
    """The battery is nearly empty for `duration_s`."""

    kind: Literal["low_battery"]


class IgnoredHalt(_Timed):
    """The base acknowledges HALT, reports its latch, and drives on, also without commands."""

    kind: Literal["ignored_halt"]


class BlockedWheels(_Timed):
    """The wheels do not turn, whatever is commanded, and the base reports no fault."""

    kind: Literal["blocked_wheels"]


class Runaway(_Timed):
    """The base drives at this velocity, whatever is commanded, until it is latched."""

    kind: Literal["runaway"]
    v_m_s: float = 0.0
    w_rad_s: float = 0.0


class Deadman(_Timed):
    """The base has this deadman from then on, and reports it."""

    kind: Literal["deadman"]
    deadman_ms: int = Field(ge=0, le=0xFFFF)


class StuckSensor(_Timed):
    """A sensor always reports the same range; without a range it reports a fault."""

    kind: Literal["stuck_sensor"]
    sensor: int = Field(ge=0, le=23)
    range_m: float | None = Field(default=None, ge=0.0)


class Outliers(_Timed):
    """Sensors report random ranges inside their window."""

    kind: Literal["outliers"]
    share: float = Field(default=0.2, gt=0.0, le=1.0)
    """Probability for each reading."""


class _Lie(_Timed):
    """A lie of sensors: what they report looks like a range, and is false."""

    sensors: TomlList[Annotated[int, Field(ge=0)]] = ()
    """Numbers of the sensors that lie; all if none is given."""


class FrozenRing(_Lie):
    """Each sensor repeats the range that it reported last, bit for bit."""

    kind: Literal["frozen_ring"]
    jitter_m: float = Field(default=0.0, ge=0.0)
    """Random noise of at most this, either way, on what it repeats."""


class SilentRing(_Lie):
    """Sensors fire and hear nothing."""

    kind: Literal["silent_ring"]
    every: int = Field(default=1, ge=1)
    """Of so many firings of a sensor one is silent."""


class ConstantRing(_Lie):
    """Sensors report one range, whatever is there."""

    kind: Literal["constant_ring"]
    range_m: float = Field(default=0.9144, ge=0.0)


class BlindNear(_Lie):
    """Sensors hear nothing of what is nearer than this."""

    kind: Literal["blind_near"]
    range_m: float = Field(default=0.4572, gt=0.0)


class DroppedReadings(_Lie):
    """Readings are missing, or silent in place of the echo."""

    kind: Literal["dropped_readings"]
    share: float = Field(default=0.9, gt=0.0, le=1.0)
    """Probability for each reading."""
    silent: bool = False
    """Whether a dropped reading is reported as silence; otherwise the sensor reports none."""


class RangeOffset(_Lie):
    """Ranges are too long by this, or too short where it is below zero."""

    kind: Literal["range_offset"]
    offset_m: float = 0.4572


class ReplayedEchoes(_Lie):
    """Sensors report again and again what they heard in the last `period_s` before the fault."""

    kind: Literal["replayed_echoes"]
    period_s: float = Field(default=2.0, gt=0.0, le=600.0)


class DelayedEchoes(_Lie):
    """Sensors report what they heard this long ago."""

    kind: Literal["delayed_echoes"]
    delay_s: float = Field(default=0.5, gt=0.0, le=600.0)


class CoarseRanges(_Lie):
    """Ranges are rounded to multiples of this step."""

    kind: Literal["coarse_ranges"]
    step_m: float = Field(default=0.25, gt=0.0)


class ReportedSilence(_Lie):
    """Sensors report this range where they hear nothing: 0, as some libraries do, or their greatest."""

    kind: Literal["reported_silence"]
    range_m: float = Field(default=0.0, ge=0.0)


class TurnedRing(_Lie):
    """The ring, or some of its sensors, each in its place, are mounted turned by this angle, counter-clockwise."""

    kind: Literal["turned_ring"]
    angle_deg: float = Field(default=90.0, ge=-360.0, le=360.0)


class SwappedSensors(_Timed):
    """The cables of two sensors are exchanged."""

    kind: Literal["swapped_sensors"]
    first: int = Field(ge=0)
    second: int = Field(ge=0)


class ClockError(_Timed):
    """The robot's clock leaps, and then runs at another rate for `duration_s`: at 0 its stamps are latched."""

    kind: Literal["clock_error"]
    rate: float = Field(default=0.0, ge=0.0, le=100.0)
    leap_s: float = Field(default=0.0, ge=-600.0, le=600.0)
    step_s: float = Field(default=0.0, ge=0.0, le=600.0)
    """Meanwhile the clock moves on in steps of this length, so that stamps repeat."""


class SuddenObject(_Timed):
    """A drum is set beside the robot for `duration_s`."""

    kind: Literal["sudden_object"]
    distance_m: float = Field(default=0.3, ge=0.0)
    """From the rim to the drum's surface."""
    bearing_deg: float = Field(default=0.0, ge=-360.0, le=360.0)
    """Direction from the robot, counter-clockwise from straight ahead."""
    radius_m: float = Field(default=0.15, gt=0.0)


class OdometryError(_Timed):
    """The odometry counts the wheels' motion times this factor: 0 freezes it, −1 has it run backwards."""

    kind: Literal["odometry_error"]
    factor: float = Field(default=0.0, ge=-10.0, le=10.0)


class OdometryJump(_Timed):
    """The odometry's pose jumps."""

    kind: Literal["odometry_jump"]
    dx_m: float = 0.0
    dy_m: float = 0.0
    dheading_rad: float = 0.0


class Unplug(_Timed):
    """The line is unplugged for `duration_s`: a hang-up, and no port to open."""

    kind: Literal["unplug"]


Fault: TypeAlias = (
    Mute
    | Deaf
    | Garbage
    | BitErrors
    | Reboot
    | Bumper
    | MotorFault
    | StopButton
    | LowBattery
    | IgnoredHalt
    | BlockedWheels
    | Runaway
    | Deadman
    | StuckSensor
    | Outliers
    | FrozenRing
    | SilentRing
    | ConstantRing
    | BlindNear
    | DroppedReadings
    | RangeOffset
    | ReplayedEchoes
    | DelayedEchoes
    | CoarseRanges
    | ReportedSilence
    | TurnedRing
    | SwappedSensors
    | ClockError
    | SuddenObject
    | OdometryError
    | OdometryJump
    | Unplug
)


class FaultScript(Strict):
    """A fault script file."""

    fault: TomlList[Annotated[Fault, Field(discriminator="kind")]] = ()


def load_faults(path: str | Path) -> tuple[Fault, ...]:
    """Return the faults of the script at `path`.

    Raises
    ------
    ConfigError
        The file cannot be read, is not TOML, or does not describe faults; a line for each problem.
    """
    shown = one_line(str(path))
    try:
        data = read_file(Path(path))
    except OSError as error:
        raise ConfigError(f"{shown}: cannot be read: {error.strerror or error}") from None
    except ValueError as error:  # a NUL in the path
        raise ConfigError(f"{shown}: not a path: {one_line(str(error))}") from None
    try:
        return FaultScript.model_validate(parse_document(data, shown)).fault
    except ValidationError as error:
        problems = (_describe(details) for details in error.errors(include_url=False))
        raise ConfigError(*(f"{shown}: {problem}" for problem in problems)) from None


def _describe(details: ErrorDetails) -> str:
    """Return in a clause which key of a fault is wrong, its value, and why."""
    # After the number of a fault, pydantic names its kind, which is not a key of the file.
    where = dotted(part for i, part in enumerate(details["loc"]) if i != 2)
    given = "" if isinstance(details["input"], dict | list | tuple) else f" = {shown_value(details['input'])}"
    text = details["msg"]
    return f"{where}{given}: {text[:1].lower()}{text[1:]}"
