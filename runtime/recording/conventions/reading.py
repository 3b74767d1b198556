"""Firings of a ring log in the form's own conventions, whatever the program that wrote it."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Final

import numpy as np

from config.robot import RobotConfig
from drivers.latched_ranges import RepeatFilter
from drivers.messages import Firing
from runtime.recording.conventions.decision import decide
from runtime.recording.conventions.options import AUTO, RingLogOptions
from runtime.recording.conventions.table import Table
from runtime.recording.ring_log import RingLogError, read_ring_log

FIRST: Final = 20_000
"""Rows on which the decision rests: a quarter of an hour at the rate of most rings, 20 MB."""


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
    rows = read_ring_log(path, sensors=len(robot.ring.mounts), is_strict=False)
    yield from converted_firings(rows, path, robot, options, warn)


def converted_firings(
    rows: Iterable[Firing], path: Path, robot: RobotConfig, options: RingLogOptions, warn: Callable[[str], None]
) -> Iterator[Firing]:
    """Yield firings converted to the form's own conventions.

    Parameters
    ----------
    rows : iterable of Firing
        As the file has them.
    path, robot, options, warn
        As of `open_ring_log`.

    Raises
    ------
    RingLogError
        As of `open_ring_log`.
    """
    rows = iter(rows)
    first = list(itertools.islice(rows, FIRST))
    if not first:
        return
    try:
        found = decide(_table(first), robot, options)
    except RingLogError as error:
        raise RingLogError(f"{path}: {error}; or name the robot file of the robot that recorded the log") from error
    if found.said:
        what = "; ".join(words for words, _ in found.said)
        warn(f"{path}: {what}. To settle it: {'; '.join(option for _, option in found.said)}")
    changes = RepeatFilter(len(robot.ring.mounts)) if found.is_latched else None
    for firing in itertools.chain(first, rows):
        one = firing if found.is_plain else found.converted(firing)
        if (one.ranges_m < 0.0).any():
            raise RingLogError(
                f"{path}: at t = {firing.robot_s!r}, a range is below 0 or nan; correct or delete the row"
            )
        yield one if changes is None else changes.fresh(one)


def _table(firings: list[Firing]) -> Table:
    return Table(
        np.array([one.robot_s for one in firings]),
        np.array([(one.pose.x, one.pose.y, one.pose.theta, one.ring_yaw) for one in firings]),
        np.array([one.ranges_m for one in firings]),
    )
