"""The conventions of a ring log as one decision: what the options say, and from the data what they leave open."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from config.robot import RingConfig, RobotConfig
from drivers.firing_pattern import FiringError, firing_pattern
from drivers.latched_ranges import RepeatFilter
from drivers.messages import CrossPaths, Firing, Floats, Pose
from runtime.recording.conventions.beams import Beams
from runtime.recording.conventions.headings import (
    NEAR_NAT,
    SURE,
    Angles,
    Motion,
    echo_scores,
    mirror_image,
    motion_scores,
    opposite,
    sureness,
)
from runtime.recording.conventions.not_fired import find_not_fired, option_of, without_not_fired
from runtime.recording.conventions.options import RingLogOptions
from runtime.recording.conventions.repeats import Repeats, find_repeats, noise_of_repeats
from runtime.recording.conventions.sensor_order import Shift, find_exchange, find_shift, mirrored_columns
from runtime.recording.conventions.silence import Silence, check_near, find_silence
from runtime.recording.conventions.table import ANGLES, HEADINGS, LENGTHS, TIMES, Table
from runtime.recording.conventions.units import Units, check_scale, find_units
from runtime.recording.conventions.way_ratios import way_ratios
from runtime.recording.ring_log import RingLogError

KERNEL: Final = 0.07
"""Width of an echo's density, as a share of the median range, where units are compared."""

_NO_SILENCE: Final = Silence()
_SI: Final = Units()
_RADIANS: Final = Angles()


@dataclass(frozen=True)
class Conventions:
    """How the rows of a log become firings.

    Attributes
    ----------
    columns : (sensors,) int, optional
        The column of each sensor where the file's order is mirrored.
    cycle_s : float, optional
        Of a log of last values, of which only changes are readings: time in which each sensor fires once.
    same_m : float
        Smaller changes are none, m.
    said : tuple of str
        What was found in the data, and the option that sets it; empty for a log in the form's own conventions.
    """

    silence: Silence = _NO_SILENCE
    not_fired: float | None = None
    units: Units = _SI
    angles: Angles = _RADIANS
    columns: NDArray[np.int64] | None = None
    cycle_s: float | None = None
    same_m: float = 0.0
    said: tuple[tuple[str, str], ...] = ()

    @property
    def is_plain(self) -> bool:
        """Whether firings pass as they are."""
        is_plain = (self.not_fired, self.silence, self.units, self.angles) == (None, _NO_SILENCE, _SI, _RADIANS)
        return self.columns is None and is_plain

    def is_same(self, other: Conventions) -> bool:
        """Return whether both convert alike, up to the widths of noise, of silence or repeats, and a cycle's time."""
        one, two = self.silence, other.silence
        is_alike = one.option == two.option and one.nan_is_silence == two.nan_is_silence
        rest, others = (
            (of.not_fired, of.units, of.angles, of.cycle_s is None, of.same_m > 0.0) for of in (self, other)
        )
        return is_alike and rest == others

    def converted(self, firing: Firing) -> Firing:
        """Return a firing in metres, radians and seconds; repeats are still in it."""
        rule, unit = HEADINGS[self.angles.heading], ANGLES[self.angles.unit]
        length, reach = LENGTHS[self.units.length], LENGTHS[self.units.range_]
        ranges = self.silence.applied(without_not_fired(firing.ranges_m, self.not_fired)) * reach
        heard = firing.cross_paths
        if heard is not None:
            listeners, transmitters = heard.listeners, heard.transmitters
            if self.columns is not None:
                listeners, transmitters = self.columns[listeners], self.columns[transmitters]
            heard = CrossPaths(transmitters, listeners, self.silence.applied(heard.half_paths_m) * reach)
        theta, yaw = rule.angles(unit * np.array([firing.pose.theta, firing.ring_yaw])).tolist()
        return Firing(
            firing.robot_s * TIMES[self.units.time],
            Pose(firing.pose.x * length, rule.hand * firing.pose.y * length, theta),
            yaw,
            ranges if self.columns is None else ranges[self.columns],
            heard,
        )


def decide(table: Table, robot: RobotConfig, options: RingLogOptions) -> Conventions:
    """Return the conventions of a log.

    Parameters
    ----------
    table : Table
        Its first part, as the file has it.
    robot : RobotConfig
        The robot that the log is said to be of.
    options : RingLogOptions
        What is known.

    Raises
    ------
    RingLogError
        The log fits no conventions, or several; the text names the options that settle it.
    """
    columns = mirrored_columns(robot.ring) if options.sensor_order == "mirrored" else None
    said = []
    set_size, pattern_s = _firing_limits(robot.ring)
    not_fired = find_not_fired(table.ranges, options.not_fired, set_size)
    if options.not_fired == "auto" and not_fired is not None:
        value = option_of(not_fired)
        said.append((f"a sensor that did not fire is {value.split()[1]}", f"{value}, or --not-fired empty if not"))
    table = table._replace(ranges=without_not_fired(table.ranges, not_fired))
    motion = motion_scores(table, options)
    likely = next(one for one in motion.scores)
    if motion.is_related:
        likely = max(motion.scores, key=motion.scores.__getitem__)
    silence = find_silence(table, options.silence, set_size, Beams.of(table, robot, likely))
    if silence.words:
        said.append((silence.words, f"--silence {silence.option}, or --silence inf if they are ranges"))
    ranges = _shown(table.ranges, silence)
    table = table._replace(ranges=ranges if columns is None else ranges[:, columns])
    repeats = _asked_repeats(table, options, set_size)
    is_latched = options.latched == "yes" or repeats.rows > 1.0
    if is_latched:
        table = table._replace(ranges=_without_repeats(table.ranges, repeats.same))
        if options.latched == "auto":
            said.append((repeats.words, "--latched yes, or no if all are fresh"))
    units, scores = find_units(table, silence, robot, options, likely.unit, _ratios(table, robot, likely))
    given = (options.time_unit, options.length_unit, options.range_unit)
    if _are_unusual(units, given):
        said.append((units.words, units.options))
    angles = _find_angles(table, robot, options, units, motion)
    if angles != _asked_angles(options):
        said.append((angles.words, angles.options))
    if options.silence == "auto":
        check_near(table.ranges, LENGTHS[units.range_], robot.ring.range_min_m, silence.option)
    if said and len(scores) > 1:
        finite = table.ranges[np.isfinite(table.ranges)]
        kernel = KERNEL * float(np.median(finite)) if len(finite) else 1.0

        def echoes(one: Units) -> Floats:
            reach = LENGTHS[one.range_]
            found = echo_scores(table, robot, [angles], reach, LENGTHS[one.length] / reach, kernel * reach)
            return found[angles]

        check_scale(units, scores, echoes)
    cycle_s = max(pattern_s, _period_s(table, units, repeats.rows)) if is_latched else None
    same_m = LENGTHS[units.range_] * repeats.same
    return Conventions(silence, not_fired, units, angles, columns, cycle_s, same_m, tuple(said))


def _firing_limits(ring: RingConfig) -> tuple[int, float]:
    """Return how many sensors fire at once at most, and the time of a cycle, s.

    A robot file whose ring cannot fire as it says is good for a log; then all may fire at once.
    """
    try:
        pattern = firing_pattern(ring)
    except FiringError:
        return len(ring.mounts), ring.firing.step_period_s
    return pattern.set_size, pattern.cycle_s


def _asked_repeats(table: Table, options: RingLogOptions, set_size: int) -> Repeats:
    """Return how values are repeated, by the option or by the data; of `--latched yes` only what noise they have."""
    if options.latched == "auto":
        return find_repeats(table, set_size)
    return Repeats(same=noise_of_repeats(table) if options.latched == "yes" else 0.0)


def _without_repeats(ranges: Floats, same: float) -> Floats:
    still = Pose(0.0, 0.0, 0.0)
    changes = RepeatFilter(ranges.shape[1], np.inf, same)
    return np.array([changes.fresh(Firing(0.0, still, 0.0, row)).ranges_m for row in ranges])


def _ratios(table: Table, robot: RobotConfig, likely: Angles) -> Floats:
    """Return the ratios of ranges to ways under the likely convention or its mirror image, whichever agree better."""
    best, least = np.empty(0), np.inf
    for hand in (1, -1):
        ratios = way_ratios(table, robot, hand * HEADINGS[likely.heading].hand * likely.yaw(table.pose[:, 3]), hand)
        spread = float(np.median(np.abs(np.log(ratios / np.median(ratios))))) if len(ratios) else np.inf
        if spread < 0.98 * least:
            best, least = ratios, spread
    return best


def _are_unusual(units: Units, given: tuple[str, ...]) -> bool:
    """Return whether a unit that was found is not that of the form."""
    return any(g == "auto" and u != plain for g, u, plain in zip(given, units, Units(), strict=True))


def _asked_angles(options: RingLogOptions) -> Angles:
    """Return how headings are counted by the options, or by the form where these leave it open."""
    return Angles(
        "ccw" if options.heading == "auto" else options.heading,
        "rad" if options.angle_unit == "auto" else options.angle_unit,
    )


def _period_s(table: Table, units: Units, period: float) -> float:
    """Return the time for which a value is repeated, s; 0 where none is."""
    if len(table.t) < 2 or period <= 1.0:
        return 0.0
    return period * (TIMES[units.time] * float(np.median(np.diff(table.t))))


def _shown(ranges: Floats, silence: Silence) -> Floats:
    """Return the ranges with inf for silence; all are at least 0.

    Raises
    ------
    RingLogError
        One is below 0.
    """
    shown = np.array([silence.applied(row) for row in ranges])
    if (shown < 0.0).any():
        raise RingLogError(f"has ranges below 0, as {float(np.nanmin(shown)):g}; correct them, or say --silence -1")
    return shown


def _find_angles(table: Table, robot: RobotConfig, options: RingLogOptions, units: Units, motion: Motion) -> Angles:
    """Return how headings are counted: the form's own way unless motion or ranges contradict it."""
    default = next(one for one in motion.scores)  # ccw and rad come first, or what is given
    if motion.turned is not None:
        _check_turned(table, robot, units, default, motion.turned)
    near, backward = _near_angles(motion, default)
    echoes = _opened(table, robot, units, list(dict.fromkeys([default, *near])))
    left = list(echoes)
    if len(left) > 1 and options.heading == "auto":
        _check_aim(table, robot, units, motion, default)
    forward = [one for one in near if one not in backward] or near  # all: it drove as far backward as forward
    ways, unshifted = [default, *near], Shift(default, 0, 0.0)
    shift = _checked_order(table, robot, options, units, forward, ways, echoes) if motion.is_related else unshifted
    fits = [one for one in left if one in near]
    if default in left and (default in near or not fits):
        doubts = [one for one in left if sureness(echoes[one], echoes[default]) > 0.5 * SURE]
        if not doubts:
            return default
        fits = [default, *doubts]
    else:
        fits = _plainest(fits, default, echoes, backward)
    shifted = f"{shift.angles.words}, and {shift.words(robot.ring)}" if shift.surely > 0.5 * SURE else ""
    return _settled(fits, left, backward, options, shifted)


def _settled(
    fits: list[Angles], left: list[Angles], backward: dict[Angles, Angles], options: RingLogOptions, shifted: str
) -> Angles:
    """Return the one way that fits; raise an error with those that are left, and a ring that may be `shifted`."""
    is_open = options.heading == options.sensor_order == "auto"
    is_mirrored = is_open and any(HEADINGS[one.heading].hand < 0 for one in fits)
    is_backward = len(fits) == 1 and fits[0] in backward and options.heading == "auto"
    if len(fits) == 1 and not (is_mirrored or is_backward):
        return fits[0]
    names = _names(fits or left, is_mirrored=is_mirrored, is_backward=is_backward)
    if shifted:
        names.insert(0, shifted)
    raise RingLogError(
        f"the robot's motion and the ranges leave open how headings are counted: {', or '.join(names)}"
    )


def _checked_order(
    table: Table,
    robot: RobotConfig,
    options: RingLogOptions,
    units: Units,
    forward: list[Angles],
    ways: list[Angles],
    echoes: dict[Angles, Floats],
) -> Shift:
    """Return how far round the ring the sensors may be shifted; raise an error if their order is surely another."""
    reach = LENGTHS[units.range_]
    scale = LENGTHS[units.length] / reach
    shift = Shift(ways[0], 0, 0.0)
    if options.sensor_order != "file":
        shift = find_shift(table, robot, forward, reach, scale, echoes.values())
    if shift.surely > SURE:
        raise RingLogError(f"later echoes fall on earlier ones only if {shift.words(robot.ring)}")
    if options.sensor_order == "auto":
        way = max(forward, key=lambda one: float(echoes[one].mean()) if one in echoes else -math.inf)
        exchange = find_exchange(table, robot, way, reach, scale, ways)
        if exchange is not None and exchange.surely > 0.5 * SURE:
            raise RingLogError(f"later echoes fall on earlier ones only if {exchange.words(robot.ring, ways)}")
    return shift


def _check_aim(table: Table, robot: RobotConfig, units: Units, motion: Motion, default: Angles) -> None:
    """Raise an error if a robot that drives only along its heading went elsewhere, and farther than its radius."""
    far_m = LENGTHS[units.length] * float(np.ptp(table.pose[:, :2], axis=0).max())
    is_unrelated = motion.is_known and not motion.is_related
    if is_unrelated and not robot.body.synchro and far_m > robot.body.radius_m:
        raise RingLogError(
            "the robot's steps do not follow theta, and the ranges do not show how headings are counted; "
            f"correct theta, or say {default.options} if {default.words}"
        )


def _check_turned(
    table: Table, robot: RobotConfig, units: Units, default: Angles, turned: tuple[Angles, float]
) -> None:
    """Raise an error if the way follows theta at an angle, unless the echoes show that the robot drove aslant."""
    one, offset_rad = turned
    pose = table.pose.copy()
    pose[:, 2:] += offset_rad / (HEADINGS[one.heading].turn * ANGLES[one.unit])
    reach = LENGTHS[units.range_]
    scale = LENGTHS[units.length] / reach
    own = echo_scores(table, robot, [default], reach, scale)[default]
    echoes = echo_scores(table._replace(pose=pose), robot, [one, mirror_image(one)], reach, scale)
    if all(sureness(own, scores) > SURE for scores in echoes.values()):
        return
    by = math.degrees(offset_rad)
    raise RingLogError(
        f"the robot moves at {by:.0f}° from its heading, where {one.words}: theta counts from another direction. "
        f"Turn theta and ring_yaw by {by:.0f}°, or say {default.options} if the robot drives so"
    )


def _near_angles(motion: Motion, default: Angles) -> tuple[list[Angles], dict[Angles, Angles]]:
    """Return the ways that fit the motion about as well as the best; and those of a robot that drives backward."""
    ways = motion.scores
    if not motion.is_related:
        # The unit stays: angles in another one hardly turn the ring, and then even noise agrees.
        return [one for one in ways if one.unit == default.unit], {}
    most = max(ways.values())
    near = [one for one in ways if ways[one] > most - NEAR_NAT]
    backward = {opposite(one): one for one in near if opposite(one) in ways}
    return [*near, *(one for one in backward if one not in near)], backward


def _plainest(
    fits: list[Angles], default: Angles, echoes: dict[Angles, Floats], backward: dict[Angles, Angles]
) -> list[Angles]:
    """Return the form's own way where echoes and motion disagree, and of the others those that are most usual."""
    if default in echoes and any(sureness(echoes[default], echoes[one]) != 0.0 for one in fits):
        fits = [default, *fits]
    fits = [one for one in fits if backward.get(one) not in fits or one == default]
    plain = [one for one in fits if one.heading == "ccw"]
    return plain if plain and default not in fits else fits


def _opened(table: Table, robot: RobotConfig, units: Units, asked: list[Angles]) -> dict[Angles, Floats]:
    """Return the likelihoods of the echoes by those of the ways asked for that they leave open."""
    reach = LENGTHS[units.range_]
    echoes = echo_scores(table, robot, asked, reach, LENGTHS[units.length] / reach)
    clearest = max(echoes, key=lambda one: float(echoes[one].mean()))
    return {one: scores for one, scores in echoes.items() if sureness(echoes[clearest], scores) < SURE}


def _names(fits: list[Angles], *, is_mirrored: bool, is_backward: bool) -> list[str]:
    """Return the ways that are left, each with the options that choose it."""
    names = [f"{one.words} ({one.options})" for one in fits[:4]]
    if is_mirrored:
        other = mirror_image(next(one for one in fits if HEADINGS[one.heading].hand < 0))
        said = f"the sensors are numbered the other way round, and {other.words}"
        names.append(f"{said} (--sensor-order mirrored {other.options})")
    if is_backward:
        names = [
            f"the robot drives backward and {names[0]}",
            "the ring is turned by 180° (write its sensors into the robot file)",
        ]
    return names
