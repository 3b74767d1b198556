"""The robot file: the ring and its firing pattern, the body, the serial line: what differs between robots."""

from __future__ import annotations

import math
from typing import Annotated, Final, Literal, NamedTuple, Self, TypeAlias, TypeVar

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ModelWrapValidatorHandler,
    model_validator,
)

from config.families.arcos import ArcosConfig
from config.families.rflex import RflexConfig
from config.families.ros2 import Ros2Config
from config.plugins import with_own_tables
from config.strict import Strict, TomlList

M = TypeVar("M", bound=BaseModel)
SOUND_SPEED_M_S = 343.0
"""Speed of sound in dry air at 20 °C, m/s; the ring's electronics assume it."""

SENSORS_MAX = 255
"""Largest number of sensors in a ring, and of sets in a firing pattern; bounds the memory for a faulty file."""

LISTEN_MAX_M: Final = 100.0
"""Longest range of any sensor, m."""
ECHO_LAG_MAX_S: Final = 0.35
"""Most by which ranges may lag behind odometry, or odometry behind ranges, s."""

PASSAGE_M: Final = 0.085
"""Room on either side of its rim with which a robot passes a gap at its cautious velocity.

The one measure of a gap: the arbiter lets the robot through, the schemas look for a way through, and what is narrower
counts as closed where dead ends are recognised. A doorway of 1.1 m leaves a robot of 2.5 ft twice as much, for echoes
and ends of walls that are known within some centimetres.
"""

_PLAIN_RINGS: Final = ("arcos", "rflex", "ros2")
"""Shipped drivers of rings whose sensors hear only their own echoes and stand on no servos."""

SensorSet: TypeAlias = Annotated[TomlList[Annotated[int, Field(ge=0, lt=SENSORS_MAX)]], Field(max_length=SENSORS_MAX)]
"""Indices of sensors that fire together."""

ListenerSet: TypeAlias = Annotated[
    TomlList[Annotated[int, Field(ge=0, lt=SENSORS_MAX)]], Field(max_length=SENSORS_MAX)
]
"""Indices of sensors that listen in one step; may be empty."""

Preset = Literal["single", "opposite_pairs", "thirds", "quadrants", "octets", "alternating"]
ListenPreset = Literal["neighbours", "second"]


class Mount(NamedTuple):
    """Place (m) and direction (rad) of one sensor in the ring's frame."""

    x_m: float
    y_m: float
    angle_rad: float


class SensorConfig(Strict):
    """One sensor of an irregular ring."""

    x_m: float = Field(ge=-10.0, le=10.0)
    """Place in the ring's frame, forward, m."""
    y_m: float = Field(ge=-10.0, le=10.0)
    """Place in the ring's frame, to the left, m."""
    angle_deg: float = Field(ge=-360.0, le=360.0)
    """Direction of its axis, degrees counter-clockwise from forward."""
    turns_with_wheels: bool = False
    """On a synchro drive: the sensor is on a part that turns with the wheels, above a base that does not, as the
    upper ring of a B21r. Its place and direction are those at the start, where the wheels point forward."""
    servo: bool = False
    """The sensor stands on a servo, which goes on to its next bearing after each of its firings; x_m and y_m are the
    servo's axis, angle_deg is the middle of its sweep."""
    bearings: int = Field(default=31, ge=2, le=SENSORS_MAX)
    """Servo: number of its bearings, equally spaced."""
    sweep_deg: float = Field(default=180.0, gt=0.0, le=360.0)
    """Servo: angle from its first bearing to its last, degrees, there and back; 360 is a turn without end, always
    counter-clockwise."""
    arm_m: float = Field(default=0.0, ge=0.0, le=1.0)
    """Servo: distance of the sensor from the servo's axis, m."""

    @property
    def views(self) -> tuple[Mount, ...]:
        """Place and direction of the sensor at each of its bearings, clockwise ones first; one without a servo."""
        middle = math.radians(self.angle_deg)
        if not self.servo:
            return (Mount(self.x_m, self.y_m, middle),)
        sweep = math.radians(self.sweep_deg)
        step = sweep / (self.bearings if self.is_endless else self.bearings - 1)
        first = middle - step * (self.bearings // 2) if self.is_endless else middle - 0.5 * sweep
        angles = [first + k * step for k in range(self.bearings)]
        return tuple(
            Mount(self.x_m + self.arm_m * math.cos(a), self.y_m + self.arm_m * math.sin(a), a) for a in angles
        )

    @property
    def is_endless(self) -> bool:
        """Whether the servo turns on and on; otherwise there and back."""
        return self.sweep_deg == 360.0


class FiringConfig(Strict):
    """The firing pattern: which sensors fire together, and how often. Give a preset or your own sets."""

    preset: Preset | None = None
    """A regular pattern by name, i.e. how many equally spaced sensors fire at a time; `alternating` fires octets and
    thirds in turn; no two sensors fire together in both, so that crosstalk can be detected."""
    sets: Annotated[TomlList[SensorSet], Field(max_length=SENSORS_MAX)] | None = None
    """Sets of sensor indices, fired in turn, instead of a preset."""
    rotations: int = Field(default=1, ge=1, le=255)
    """Repeat `sets` this many times, each time shifted by one sensor around the ring."""
    listen_preset: ListenPreset | None = None
    """Which sensors listen without firing, on a ring that can, by name: the `neighbours` of those that fire, or the
    `second` ones, two places on."""
    listen: Annotated[TomlList[ListenerSet], Field(max_length=SENSORS_MAX)] | None = None
    """Sets of sensor indices that listen, instead of a listen_preset: one for each of `sets`, rotated with them, or
    one for each step of a preset."""
    step_period_s: float = Field(default=0.05, ge=0.001, le=60.0)
    """Time from one firing to the next, s."""
    window_m: float | None = Field(default=None, gt=0.0, le=LISTEN_MAX_M)
    """Range up to which each firing listens, m; by default `ring.range_max_m`."""

    @model_validator(mode="after")
    def _one_pattern(self) -> FiringConfig:
        if (self.preset is None) == (self.sets is None):
            raise ValueError("give either preset or sets, one of the two")
        if self.sets is not None and not self.sets:
            raise ValueError("sets is empty: give at least one set of sensors")
        if self.sets is not None and any(len(s) == 0 or len(set(s)) != len(s) for s in self.sets):
            raise ValueError("each set needs at least one sensor, and each sensor once only")
        if self.listen_preset is not None and self.listen is not None:
            raise ValueError("give either listen_preset or listen, not both")
        if self.listen is not None:
            self._check_listeners(self.listen)
        return self

    @property
    def has_listeners(self) -> bool:
        """Whether the pattern asks sensors to listen without firing."""
        return self.listen_preset is not None or self.listen is not None

    def _check_listeners(self, listen: tuple[tuple[int, ...], ...]) -> None:
        if any(len(set(s)) != len(s) for s in listen):
            raise ValueError("each set of listen may name each sensor once only")
        if self.sets is None:
            return
        if len(listen) != len(self.sets):
            raise ValueError(f"listen has {len(listen)} sets for the {len(self.sets)} of sets: give one for each")
        for number, (fired, heard) in enumerate(zip(self.sets, listen, strict=True)):
            if both := sorted(set(fired) & set(heard)):
                raise ValueError(
                    f"listen[{number}] names sensor {', '.join(map(str, both))}, which fires in that set: a sensor "
                    f"that fires hears its own echo, so leave it out"
                )


def _preset_as_table(value: object) -> object:
    """Return ``{preset = "octets"}`` for ``firing = "octets"``."""
    return {"preset": value} if isinstance(value, str) else value


class RingConfig(Strict):
    """The ring of sensors: regular (count and radius_m) or listed individually (sensors)."""

    count: int | None = Field(default=None, ge=1, le=SENSORS_MAX)
    """Number of sensors of a regular ring; sensor 0 looks forward, the others follow counter-clockwise."""
    radius_m: float | None = Field(default=None, ge=0.0, le=10.0)
    """Radius of a regular ring, m."""
    sensors: Annotated[TomlList[SensorConfig], Field(max_length=SENSORS_MAX)] | None = None
    """The sensors one by one, instead of `count` and `radius_m`."""
    beam_half_angle_deg: float = Field(gt=0.0, lt=90.0)
    """Half the width of a sensor's beam, degrees."""
    resolution_m: float = Field(ge=0.0, lt=1.0)
    """Quantisation step of the reported range, m; 0 = not quantised."""
    range_min_m: float = Field(ge=0.0, lt=100.0)
    """Least range that a sensor reports, m."""
    range_max_m: float = Field(gt=0.0, le=LISTEN_MAX_M)
    """Greatest range that a sensor reports, m."""
    firing: Annotated[FiringConfig, BeforeValidator(_preset_as_table)] = FiringConfig(preset="octets")
    """The firing pattern: a preset's name, or a table."""
    echo_lag_s: float = Field(default=0.0, ge=-ECHO_LAG_MAX_S, le=ECHO_LAG_MAX_S)
    """Time by which the ranges lag behind odometry, s, as `echolocate calibrate` finds it; below 0, odometry lags. A
    run that knows of one, or corrects drift, estimates it as the robot drives, beginning with this."""

    @model_validator(mode="after")
    def _whole_ring(self) -> RingConfig:
        regular = self.count is not None and self.radius_m is not None
        partly = self.count is not None or self.radius_m is not None
        if (self.sensors is None) != regular or (self.sensors is not None and partly):
            raise ValueError("give either count and radius_m, or sensors")
        if self.sensors is not None and not self.sensors:
            raise ValueError("sensors is empty: a ring needs at least one")
        if self.range_min_m >= self.range_max_m:
            raise ValueError(f"range_min_m {self.range_min_m} is not below range_max_m {self.range_max_m}")
        if self.has_servo:
            if (count := len(self.mounts)) > SENSORS_MAX:
                raise ValueError(
                    f"the bearings of all sensors are {count}, at most {SENSORS_MAX}: use fewer bearings"
                )
            if self.firing.has_listeners:
                raise ValueError("firing.listen_preset or listen: a ring with a servo cannot listen; remove it")
        return self

    @property
    def mounts(self) -> tuple[Mount, ...]:
        """Place (m) and direction (rad) of each sensor, by index; a sensor on a servo counts once for each bearing.

        Everything that knows sensors by their index so takes a servo's sensor as one sensor for each bearing. Only
        the wire and ring logs number the sensors themselves: see `drivers.servo_views`.
        """
        if self.sensors is not None:
            return tuple(view for sensor in self.sensors for view in sensor.views)
        count, radius = self.count or 0, self.radius_m or 0.0
        angles = [2.0 * math.pi * i / count for i in range(count)]
        return tuple(Mount(radius * math.cos(a), radius * math.sin(a), a) for a in angles)

    @property
    def turning(self) -> tuple[int, ...]:
        """The sensors that turn with the wheels of a synchro drive, by index."""
        views = (sensor for sensor in self.sensors or () for _ in sensor.views)
        return tuple(i for i, sensor in enumerate(views) if sensor.turns_with_wheels)

    @property
    def sensor_count(self) -> int:
        """Number of sensors; one on a servo counts once."""
        return (self.count or 0) if self.sensors is None else len(self.sensors)

    @property
    def sensor_of(self) -> tuple[int, ...]:
        """The sensor of each mount: the mount's own index, but for a ring with a servo."""
        if self.sensors is None:
            return tuple(range(self.sensor_count))
        return tuple(i for i, sensor in enumerate(self.sensors) for _ in sensor.views)

    @property
    def has_servo(self) -> bool:
        """Whether a sensor stands on a servo."""
        return any(sensor.servo for sensor in self.sensors or ())

    @property
    def lone_servo(self) -> SensorConfig | None:
        """The ring's only sensor, if it stands on a servo that sweeps half a turn or more."""
        first, *others = self.sensors or (None,)
        return first if first is not None and first.servo and not others and first.sweep_deg >= 180.0 else None

    @property
    def window_m(self) -> float:
        """Range up to which a firing listens, m."""
        return self.range_max_m if self.firing.window_m is None else self.firing.window_m


class BodyConfig(Strict):
    """The base: its size, its limits, and whether the ring turns with the wheels."""

    radius_m: float = Field(gt=0.0, le=10.0)
    """Radius of the body, m."""
    speed_max_m_s: float = Field(gt=0.0, le=10.0)
    """Largest speed, m/s."""
    turn_max_rad_s: float = Field(gt=0.0, le=20.0)
    """Largest turning rate, rad/s."""
    acceleration_max_m_s2: float = Field(default=0.5, gt=0.0, le=50.0)
    """Largest acceleration and deceleration, m/s²."""
    turn_acceleration_max_rad_s2: float = Field(default=2.0, gt=0.0, le=100.0)
    """Largest angular acceleration, rad/s²."""
    synchro: bool = False
    """Synchro drive: the wheels turn, the body with its ring does not, but for sensors with `turns_with_wheels`."""
    turns_at_start: bool = False
    """Turn once on the spot before the first drive: sensors that are exchanged, backwards or deaf show then."""


BY_HAND_MAX: Final = 16
"""Greatest ring that counts as wired by hand: its sensors may be exchanged, or fire together as they should not."""
NO_BODY: Final = BodyConfig(radius_m=0.3, speed_max_m_s=10.0, turn_max_rad_s=20.0)
"""Of a robot file without a body, which is good for replays and stands; a run refuses it. A replay takes what moves a
ring for wrong units only beyond these speeds."""


class LinkConfig(Strict):
    """The serial line to the robot and its timeouts."""

    port: str | None = None
    """Serial port of the robot, as /dev/ttyUSB0, socket://host:port, or "ros2" for the driver of that name; without
    one a run starts the emulator."""
    baud: int = Field(default=115200, ge=300, le=4_000_000)
    """Speed of the line, bits per second."""
    reply_timeout_s: float = Field(default=0.1, ge=0.001, le=10.0)
    """Time after which an unanswered command is sent again, s."""
    tries: int = Field(default=3, ge=1, le=100)
    """Unanswered tries after which the link is down."""
    silence_max_s: float = Field(default=0.4, ge=0.05, le=60.0)
    """Time without odometry after which the link is down, s; a robot at rest sends it too."""
    deadman_min_s: float = Field(default=0.1, ge=0.02, le=10.0)
    """Least deadman of a base, s: one that reports a shorter one would stop between two cycles and is refused."""
    deadman_max_s: float = Field(default=1.0, ge=0.02, le=10.0)
    """Greatest deadman of a base, s: so long does it drive on if the program hangs. A longer one is refused."""
    reopen_first_s: float = Field(default=0.05, gt=0.0, le=60.0)
    """Wait before the first attempt to reopen the port, s; it doubles with each attempt."""
    reopen_max_s: float = Field(default=0.5, gt=0.0, le=600.0)
    """Longest wait between such attempts, s."""

    @property
    def answer_max_s(self) -> float:
        """Longest time until a command shows in the odometry, s: every try, and then the next sample."""
        return self.reply_timeout_s * self.tries + self.silence_max_s

    @model_validator(mode="after")
    def _ordered(self) -> LinkConfig:
        if self.deadman_min_s > self.deadman_max_s:
            raise ValueError(f"deadman_min_s {self.deadman_min_s} is above deadman_max_s {self.deadman_max_s}")
        return self


class DriverConfig(Strict):
    """The robot's name and its driver."""

    name: str | None = Field(default=None, min_length=1, max_length=64)
    """What the robot is called on the page, in the log and in recordings; by default what it calls itself."""
    driver: str = Field(default="denning", min_length=1, max_length=64)
    """Name of a shipped driver, or of one that an installed package provides: entry points `echolocate.drivers`."""
    protocol: int | None = Field(default=None, ge=1, le=255)
    """Version of the protocol, for a driver that knows several; by default the newest that the robot speaks."""


class CalibrationConfig(Strict):
    """What this robot's odometry and ranges are wrong by, as `echolocate calibrate` finds it: reported over true."""

    distance_scale: float = Field(default=1.0, ge=0.5, le=2.0)
    """Distance that the odometry reports, over the true one."""
    turn_scale: float = Field(default=1.0, ge=0.5, le=2.0)
    """Turn that the odometry reports, over the true one."""
    range_scale: float = Field(default=1.0, ge=0.5, le=2.0)
    """Range that the ring reports, over the true one."""


class RobotConfig(Strict):
    """A robot file: `[robot]`, `[ring]`, `[body]`, `[link]`, `[calibration]`, and a section of the driver's own.

    An installed driver's own section has the driver's name, and is what `own_table` returns.
    """

    model_config = ConfigDict(extra="allow")

    robot: DriverConfig = DriverConfig()
    ring: RingConfig
    body: BodyConfig = NO_BODY
    link: LinkConfig = LinkConfig()
    calibration: CalibrationConfig = CalibrationConfig()
    arcos: ArcosConfig = ArcosConfig()
    """Of the driver "arcos", for the Pioneer family."""
    rflex: RflexConfig = RflexConfig()
    """Of the driver "rflex", for the B21r, ATRV-Jr and Magellan."""
    ros2: Ros2Config = Ros2Config()
    """Of the driver "ros2", for robots that run ROS 2."""

    @model_validator(mode="wrap")
    @classmethod
    def _with_own_tables(cls, data: object, handler: ModelWrapValidatorHandler[Self]) -> Self:
        """Validate the sections of installed drivers by their own models; any other key is unknown."""
        return with_own_tables(cls, data, handler)

    def own_table(self, name: str, model: type[M]) -> M:
        """Return the section of an installed driver; the model's defaults where the file has none.

        The section has the driver's name; `model` is its `Config`.
        """
        found = (self.model_extra or {}).get(name)
        return found if isinstance(found, model) else model()

    @model_validator(mode="after")
    def _can_turn(self) -> RobotConfig:
        if self.ring.has_servo and (self.robot.driver in _PLAIN_RINGS or self.robot.protocol == 1):
            which = "version 1 of the protocol" if self.robot.protocol == 1 else f'the driver "{self.robot.driver}"'
            raise ValueError(
                f"ring.sensors: {which} has no sensors on servos; remove servo = true, or use the driver "
                f'"denning" with protocol = 2, as the firmware of `echolocate firmware` does'
            )
        return self

    @model_validator(mode="after")
    def _can_listen(self) -> RobotConfig:
        if not self.ring.firing.has_listeners:
            return self
        if self.robot.driver in _PLAIN_RINGS:
            raise ValueError(
                f'ring.firing.listen_preset or listen: a ring with the driver "{self.robot.driver}" cannot listen '
                f"without firing; remove it"
            )
        if self.robot.protocol == 1:
            raise ValueError(
                "ring.firing.listen_preset or listen: version 1 of the protocol has no listeners; remove it, or set "
                "robot.protocol = 2 if the robot speaks it"
            )
        return self
