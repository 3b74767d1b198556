"""Firings of a ring log in the form's own conventions, whatever the program that wrote it."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from config.robot import RingConfig, RobotConfig
from drivers.latched_ranges import RepeatFilter
from drivers.messages import Firing
from perception.localization.submaps.echo_lag import lag_of
from runtime.recording.conventions.decision import Conventions, decide
from runtime.recording.conventions.echo_lag import at_heard_poses, pose_between
from runtime.recording.conventions.not_fired import option_of
from runtime.recording.conventions.options import AUTO, RingLogOptions
from runtime.recording.conventions.table import LENGTHS, Table
from runtime.recording.ring_log import RingLogError, read_ring_log
from runtime.recording.servo_columns import ServoColumns

FIRST: Final = 20_000
"""Rows on which the decision rests: a quarter of an hour at the rate of most rings, 20 MB."""
LAG_ROWS: Final = 4000
"""Rows from which the lag of ranges behind poses is found: enough for the lag of most logs to ± 0.02 s."""
ROUNDING: Final = 1e-12
"""Least share of the greatest coordinate that counts as a change: some thousand roundings of a double."""
FIRST_OF_PIPE: Final = 400
"""Rows of a pipe, whose reader waits for the first firing: less than half a minute of most rings."""


def open_ring_log(
    path: Path, robot: RobotConfig, options: RingLogOptions = AUTO, warn: Callable[[str], None] = lambda _: None
) -> Iterator[Firing]:
    """Yield the firings of a ring log in metres, radians and seconds, without repeats.

    A log in these conventions passes unchanged to the bit.

    Parameters
    ----------
    path : Path
        The file.
    robot : RobotConfig
        The robot that the log is said to be of.
    options : RingLogOptions
        What is known of its conventions.
    warn : callable
        Gets one line on what was found and converted, before the first firing.

    Raises
    ------
    RingLogError
        The file cannot be read, is invalid, or its conventions are ambiguous; the text names the option to give.
    """
    options.check()
    rows = _rows(path, robot, options)
    first = FIRST if path.is_file() else FIRST_OF_PIPE
    yield from converted_firings(rows, path, robot, options, warn, first=first)


def check_begin(path: Path, robot: RobotConfig, options: RingLogOptions) -> None:
    """Raise `RingLogError` if the options, the file's header or its first row are invalid; no row of a pipe is read.

    This is quick, other than the first firing of `open_ring_log`, for which the conventions are decided.
    """
    options.check()
    if path.is_file() or not path.exists():
        next(_rows(path, robot, options), None)


def _rows(path: Path, robot: RobotConfig, options: RingLogOptions) -> Iterator[Firing]:
    """Return the firings as the file has them."""
    return read_ring_log(
        path,
        sensors=robot.ring.sensor_count,
        is_strict=(options.silence, options.not_fired) == ("inf", "empty"),
        servos=ServoColumns(robot.ring),
    )


def converted_firings(
    rows: Iterable[Firing],
    path: Path,
    robot: RobotConfig,
    options: RingLogOptions,
    warn: Callable[[str], None],
    *,
    first: int = FIRST,
) -> Iterator[Firing]:
    """Yield firings converted to the form's own conventions.

    Parameters
    ----------
    rows : iterable of Firing
        As the file has them.
    path, robot, options, warn
        As of `open_ring_log`.
    first : int
        Rows on which the decision rests. It is made again at each doubling, until `FIRST`.

    Raises
    ------
    RingLogError
        As of `open_ring_log`, or later rows contradict what the first ones showed.
    """
    rows = iter(rows)
    seen = list(itertools.islice(rows, first))
    if not seen:
        return
    found = _decided(seen, path, robot, options)
    if found.said:
        warn(_found_words(path, found))
    every = itertools.chain(seen, rows if first >= FIRST else _confirmed(rows, seen, found, path, robot, options))
    firings: Iterator[Firing] = (one if found.is_plain else found.converted(one) for one in every)
    if found.cycle_s is not None:
        firings = _without_repeats(firings, robot.ring, found.cycle_s, found.same_m)
    firings = _at_heard_poses(firings, path, robot.ring, options, warn, rows=min(first, LAG_ROWS))
    yield from _checked(firings, path, LENGTHS[found.units.range_])


def _decided(seen: list[Firing], path: Path, robot: RobotConfig, options: RingLogOptions) -> Conventions:
    """Return the conventions that the first firings show.

    Raises
    ------
    RingLogError
        They show none; the text names the file.
    """
    try:
        return decide(_table(seen), robot, options)
    except RingLogError as error:
        raise RingLogError(f"{path}: {error}; or name the robot file of the robot that recorded the log") from error


def _found_words(path: Path, found: Conventions) -> str:
    if not found.said:  # of what options leave open: noise on what is repeated
        return f"{path}: later rows are in the form's own conventions, or repeat values with noise"
    what = "; ".join(words for words, _ in found.said)
    return f"{path}: {what}. To settle it: {'; '.join(option for _, option in found.said)}"


def _confirmed(
    rows: Iterator[Firing],
    first: list[Firing],
    found: Conventions,
    path: Path,
    robot: RobotConfig,
    options: RingLogOptions,
) -> Iterator[Firing]:
    """Yield later rows; raise an error if the rows until then show other conventions than the first ones."""
    seen, due = list(first), 2 * len(first)
    for row in rows:
        if len(seen) < FIRST:
            seen.append(row)
            if len(seen) == due:
                due *= 2
                later = _decided(seen, path, robot, options)
                if not later.is_same(found):
                    raise RingLogError(
                        f"{_found_words(path, later)}. The first {len(first)} rows did not show it: "
                        "give the options, or the file instead of a pipe"
                    )
        yield row


def _without_repeats(firings: Iterable[Firing], ring: RingConfig, cycle_s: float, same_m: float) -> Iterator[Firing]:
    """Yield the firings of a log of last values without repeats, from where the robot was when they were fired.

    Values that are new in a row are of the firings since the row before, or of the last cycle if that is shorter. A
    row is at its last firing, so they were fired half of that time without a step earlier on average. Over 12 drives,
    drums then lie 1 mm from those of the fresh log; 4 mm from them without this.
    """
    step_s = ring.firing.step_period_s
    changes = RepeatFilter(len(ring.mounts), cycle_s, same_m)
    last: Firing | None = None
    for firing in firings:
        fresh = changes.fresh(firing)
        if last is not None:
            dt = firing.robot_s - last.robot_s
            back = 0.5 * max(0.0, min(dt, cycle_s) - step_s) / dt if dt > 0.0 else 0.0
            pose, ring_yaw = pose_between(firing, last, back)
            fresh = replace(fresh, pose=pose, ring_yaw=ring_yaw)
        last = firing
        yield fresh


def _at_heard_poses(
    firings: Iterator[Firing],
    path: Path,
    ring: RingConfig,
    options: RingLogOptions,
    warn: Callable[[str], None],
    *,
    rows: int,
) -> Iterator[Firing]:
    """Yield firings at the poses from which they were heard: by the option, the robot file, or the first rows."""
    lag_s, begin = options.echo_lag_s, list[Firing]()
    if lag_s is None:
        begin = list(itertools.islice(firings, rows))
        found = lag_of(begin, ring)
        lag_s = found.lag_s if found.is_refuted else ring.echo_lag_s
        if found.is_refuted:
            warn(
                f"{path}: {found}, which is taken into account. To settle it: --echo-lag {lag_s:.2f}, or "
                f"echo_lag_s = {lag_s:.2f} in the robot's [ring]"
            )
    yield from at_heard_poses(itertools.chain(begin, firings), lag_s)


def _checked(firings: Iterable[Firing], path: Path, unit_m: float) -> Iterator[Firing]:
    """Yield the firings, once all conventions have been applied; `unit_m` is the file's unit of ranges.

    Raises
    ------
    RingLogError
        A range is still negative.
    """
    for firing in firings:
        if (wrong := firing.ranges_m[firing.ranges_m < 0.0]).size:
            option = option_of(float(wrong.min()) / unit_m)
            word = option.removeprefix("--not-fired ")
            raise RingLogError(
                f"{path}: at t = {firing.robot_s!r}, a range is {word}; correct or delete the row, or say "
                f"{option} if the sensor did not fire then, or --silence {word} if it heard nothing"
            )
        yield firing


def _table(firings: list[Firing]) -> Table:
    """Return firings as a table; all have the same number of sensors.

    Poses are rounded to `ROUNDING` of the greatest: a robot that stands has not moved by what interpolation rounds.
    """
    pose = np.array([(one.pose.x, one.pose.y, one.pose.theta, one.ring_yaw) for one in firings])
    for part in (pose[:, :2], pose[:, 2:]):
        unit = ROUNDING * float(np.abs(part).max())
        if unit > 0.0:
            part[:] = np.round(part / unit) * unit
    return Table(np.array([one.robot_s for one in firings]), pose, np.array([one.ranges_m for one in firings]))
