"""The registry of robot drivers: the shipped ones, and those that installed packages add.

No other module imports a driver's package; `config` describes the shipped ones' sections of a robot file. A package
adds a driver with an entry point of the group `echolocate.drivers`, whose name is what a robot file gives as
`[robot] driver`::

    [project.entry-points."echolocate.drivers"]
    myrobot = "my_package.myrobot"

The entry point names an object with the functions of `DriverFamily`; a module will do.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from importlib.metadata import EntryPoint
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final, Protocol, TypedDict, cast

from config.plugins import PluginError, load_plugin, plugged
from config.robot import CalibrationConfig, DriverConfig
from drivers.calibrated_driver import CalibratedDriver
from drivers.capabilities import CAPABILITIES
from drivers.driver import DriverError, DriverPackageError
from drivers.firing_pattern import firing_pattern
from drivers.latched_ranges import FreshDriver
from drivers.serial_port import OpenPort
from drivers.session import Session

if TYPE_CHECKING:
    from config.robot import RobotConfig
    from config.world import WorldConfig
    from drivers.driver import RobotDriver
    from drivers.emulator.faults import Fault
    from drivers.emulator.robot_device import RobotDevice

GROUP: Final = "echolocate.drivers"

SHIPPED: Final[Mapping[str, EntryPoint]] = MappingProxyType(
    {name: EntryPoint(name, f"drivers.{name}.family", GROUP) for name in ("arcos", "denning", "rflex", "ros2")}
)


class DriverFamily(Protocol):
    """Both ends of one robot family's protocol.

    A family may also have: `HAS`, what its robots can do (`capabilities`); `deadman_s`, a function of the robot file;
    `line_options`, for a line of its own; `frames_in`, a function that counts its frames in bytes, with `ROBOT`, what
    such a robot is called (`other_robot`). Each is described at the function here that asks for it.
    """

    def make_driver(self, config: RobotConfig) -> RobotDriver:
        """Return a driver for the robot that `config` describes.

        Raises
        ------
        drivers.firing_pattern.FiringError
            The robot or its protocol cannot carry out the firing pattern of `config`.
        """

    def make_device(
        self, config: RobotConfig, world: WorldConfig, seed: int, *, faults: Sequence[Fault], clock_start_us: int
    ) -> RobotDevice:
        """Return an emulated robot that answers the driver of `config`.

        Arguments are as of `registry.make_device`, which calls it. A family without an emulator raises `DriverError`.
        """


FOREIGN_MIN: Final = 2
"""Fewest frames of another family that name it: a single one may be chance."""


def known_drivers() -> dict[str, EntryPoint]:
    """Return all installed drivers by name; a shipped driver takes precedence over another of its name."""
    return {**plugged(GROUP), **SHIPPED}


def driver_names() -> tuple[str, ...]:
    """Return the names of all installed drivers as one chooses from them: the usual one first, then the shipped."""
    shipped = [DriverConfig().driver, *sorted(SHIPPED.keys() - {DriverConfig().driver})]
    return (*shipped, *sorted(known_drivers().keys() - SHIPPED.keys()))


def capabilities(config: RobotConfig) -> frozenset[str]:
    """Return what the robots of a driver can do; a family that lists nothing in `HAS` can do all.

    Raises
    ------
    DriverError
        There is no driver named `config.robot.driver`, or it cannot be loaded.
    """
    return frozenset(getattr(_family(config.robot.driver), "HAS", CAPABILITIES))


def deadman_s(config: RobotConfig) -> float | None:
    """Return the longest time without a command until a base stops by itself, s; None if it never does.

    A family whose robot file says so has a function `deadman_s` of the file. The others' robots report their own, and
    `link.deadman_max_s` is the longest with which a run begins.

    Raises
    ------
    DriverError
        There is no driver named `config.robot.driver`, or it cannot be loaded.
    """
    if "deadman" not in capabilities(config):
        return None
    of_file: Callable[[RobotConfig], float] | None = getattr(_family(config.robot.driver), "deadman_s", None)
    return config.link.deadman_max_s if of_file is None else of_file(config)


def make_driver(config: RobotConfig) -> RobotDriver:
    """Return a driver for the robot that `config` describes.

    Raises
    ------
    DriverError
        There is no driver named `config.robot.driver`, or it cannot be loaded.
    drivers.firing_pattern.FiringError
        The robot or its protocol cannot carry out the firing pattern of `config`.
    """
    family = _family(config.robot.driver)
    driver = family.make_driver(config)
    if isinstance(driver, Session) and _names_frames(family):
        driver.heard.find_robot = partial(other_robot, config.robot.driver)
    if not _names_frames(family):  # it may be a source that repeats last values
        pattern, count = firing_pattern(config.ring), len(config.ring.mounts)
        if pattern.set_size < count:
            driver = cast("RobotDriver", FreshDriver(driver, count, pattern.set_size, pattern.cycle_s))
    if config.calibration == CalibrationConfig():
        return driver
    return cast("RobotDriver", CalibratedDriver(driver, config.calibration, synchro=config.body.synchro))


def make_device(
    config: RobotConfig, world: WorldConfig, seed: int, *, faults: Sequence[Fault] = (), clock_start_us: int = 0
) -> RobotDevice:
    """Return an emulated robot that answers the driver of `config`; its odometry and ranges err as the file says.

    Parameters
    ----------
    config
        The robot.
    world
        What surrounds the robot, and where in it the robot starts.
    seed
        Seed of all random numbers: the same seed and input give the same output.
    faults
        What goes wrong with the robot or its line, and when.
    clock_start_us
        First reading of the robot's own clock, µs: 0 on a real robot, near its end to see it wrap soon.

    Raises
    ------
    DriverError
        There is no driver named `config.robot.driver`, it cannot be loaded, it has no emulator, or its
        protocol cannot express `config`.
    """
    world = _with_errors(world, config.calibration)
    family = _family(config.robot.driver)
    return family.make_device(config, world, seed, faults=faults, clock_start_us=clock_start_us)


class LineOptions(TypedDict, total=False):
    """How `drivers.link.Link` opens a line that is neither a serial port nor a TCP connection."""

    opener: OpenPort
    open_timeout_s: float


def line_options(config: RobotConfig) -> LineOptions:
    """Return how the robot's line is opened, as arguments of `drivers.link.Link`; none for a port or a connection.

    A family that opens its line itself has a function `line_options` of the robot file.

    Raises
    ------
    DriverError
        There is no driver named `config.robot.driver`, or it cannot be loaded.
    """
    options: Callable[[RobotConfig], LineOptions] | None
    options = getattr(_family(config.robot.driver), "line_options", None)
    return LineOptions() if options is None else options(config)


def other_robot(driver: str, data: bytes) -> str | None:
    """Return the shipped family, other than that of `driver`, whose robot sends these bytes, as a phrase.

    Such a family has a function `frames_in`, which counts the robot's frames in bytes, and a phrase `ROBOT`.
    """
    for name in sorted(SHIPPED.keys() - {driver}):
        family: Any = _family(name)
        if _names_frames(family) and family.frames_in(data) >= FOREIGN_MIN:
            return str(family.ROBOT)
    return None


def import_families() -> None:
    """Import the shipped families: `other_robot` needs them all, in the cycle in which a line fails."""
    for name in SHIPPED:
        _family(name)


def _names_frames(family: DriverFamily) -> bool:
    """Return whether a family's protocol names its frames, and with them what fired."""
    return hasattr(family, "frames_in")


def _family(name: str) -> DriverFamily:
    """Return the family of a driver's name, imported.

    Raises
    ------
    DriverError
        There is none, or it cannot be imported.
    """
    entry = SHIPPED.get(name) or known_drivers().get(name)
    if entry is None:
        raise DriverError(
            f'robot.driver = "{name}": no such driver; known drivers: {", ".join(sorted(known_drivers()))}; correct '
            f"the name, or install the package that provides the driver"
        )
    try:
        return cast("DriverFamily", load_plugin(entry))
    except PluginError as error:
        raise DriverPackageError(f'robot.driver = "{name}": {error}') from error


def _with_errors(world: WorldConfig, errors: CalibrationConfig) -> WorldConfig:
    """Return a world in which the robot's odometry and ranges have these errors beside the world's own."""
    odometry, acoustics = world.odometry, world.acoustics
    scales = {"scale": odometry.scale * errors.distance_scale, "turn_scale": odometry.turn_scale * errors.turn_scale}
    sound = {"sound_speed_scale": acoustics.sound_speed_scale / errors.range_scale}
    update = {"odometry": odometry.model_copy(update=scales), "acoustics": acoustics.model_copy(update=sound)}
    return world.model_copy(update=update)
