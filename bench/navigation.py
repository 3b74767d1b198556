"""Drives to goals in rooms that the robot does not know: ours beside the schemas of before and what others use.

In random rooms of the emulator, or in real buildings: walls cut from a laser's recording, start and goal on its way.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from bench.laser_rooms import LaserLog, read_carmen, walls_around, world_walls
from bench.peers.nav2_recovery import Nav2Recovery
from bench.peers.playerproject_vfh import PlayerprojectVfh
from bench.peers.vff import Vff
from bench.trials.navigation_trials import (
    ACOUSTICS,
    ODOMETRY,
    MakeController,
    OurCycle,
    Trial,
    TrialResult,
    closed_room_m,
    figures,
    make_trial,
    random_trial,
    run_trial,
)
from bench.trials.shortest_way import free_space
from config.load import load_settings
from config.settings import Settings
from config.world import WorldConfig
from drivers.messages import Floats, Pose
from runtime.cycle import goal_drive

AROUND_M: Final = 9.0
"""Walls up to this far from start and goal are in the world: the ring hears less far."""
STRAIGHT_M: Final = (4.0, 9.0)
WAY_MAX_M: Final = 16.0
"""How far the goals are, in a straight line and along the shortest way."""

WITHOUT: Final = (
    "perception.method=paper",
    "behaviors.follow_valley.follow_valley_gain=0.0",
    "behaviors.leave_canyon.leave_canyon_gain=0.0",
    "behaviors.move_to_goal.stuck_after_s=3600.0",
    "behaviors.move_to_goal.unreachable_after_s=3600.0",
    "behaviors.move_to_goal.turn_rate_max_rad_s=20.0",
    "behaviors.move_to_goal.turn_acceleration_max_rad_s2=100.0",
)
"""Settings of the schemas before; their drives are not given up."""
GRID: Final = ("perception.grid.method=directed",)
METHODS: Final[Mapping[str, tuple[MakeController, tuple[str, ...]]]] = MappingProxyType(
    {
        "schemas before": (OurCycle, WITHOUT),
        "nav2's recoveries": (Nav2Recovery, WITHOUT),
        "VFF": (Vff, ()),
        "VFH of playerproject": (PlayerprojectVfh, ()),
        "ours, VFH+": (OurCycle, (*GRID, "behaviors.follow_valley.look_ahead_nodes_max=0")),
        "ours": (OurCycle, GRID),
    }
)


def laser_trials(path: Path, count: int, settings: Settings, seed: int = 0) -> list[Trial]:
    """Return drives between places that a laser has passed.

    Parameters
    ----------
    path : Path
        A CARMEN log.
    count : int
        Number of drives.
    settings : Settings
        Of the robot that has to fit.
    seed : int
        Of the choice.
    """
    log = read_carmen(path)
    walls = world_walls(log)
    rng = np.random.default_rng(np.random.SeedSequence([seed, 57]))
    found: list[Trial] = []
    for _ in range(400 * count):
        if len(found) == count:
            break
        i, j = rng.integers(0, len(log.poses), 2).tolist()
        trial = _between(log, walls, i, j, float(rng.uniform(-math.pi, math.pi)), settings)
        if trial is not None:
            found.append(trial)
    return found


def _between(log: LaserLog, walls: Floats, i: int, j: int, heading: float, settings: Settings) -> Trial | None:
    start, goal = log.poses[i, :2], log.poses[j, :2]
    if not STRAIGHT_M[0] <= math.dist(start, goal) <= STRAIGHT_M[1]:
        return None
    low, high = np.minimum(start, goal) - AROUND_M, np.maximum(start, goal) + AROUND_M
    world = WorldConfig(wall=walls_around(walls, low, high), acoustics=ACOUSTICS, odometry=ODOMETRY)
    space = free_space(world, closed_room_m(settings))
    trial = make_trial(
        world, space, Pose(float(start[0]), float(start[1]), heading), (float(goal[0]), float(goal[1]))
    )
    return trial if trial is not None and trial.shortest_m <= WAY_MAX_M else None


def measure(
    trials: Sequence[Trial], methods: Sequence[str], sets: Sequence[str], report: Callable[[str], None]
) -> dict[str, dict[str, float]]:
    """Return the figures of each method over the same drives.

    Parameters
    ----------
    trials : sequence of Trial
        The drives.
    methods : sequence of str
        Of `METHODS`.
    sets : sequence of str
        Settings to override in all methods.
    report : callable
        Called with a line on what is running.
    """
    rows = {}
    for name in methods:
        make_controller, own = METHODS[name]
        settings = load_settings("hallway", (*own, *sets))
        results: list[TrialResult] = []
        with _timed("follow_valley") as cycles_ms, _timed("expand") as quanta_ms:
            for k, trial in enumerate(trials):
                results.append(run_trial(trial, settings, make_controller, k))
                report(f"{name}: {k + 1} of {len(trials)}, {results[-1].outcome}")
        row = figures(trials, results, settings.behaviors.arbiter.base_velocity_m_s)
        if cycles_ms:
            row["cycle_ms_median"] = float(np.median(cycles_ms))
            row["cycle_ms_p99"] = float(np.quantile(cycles_ms, 0.99))
        if quanta_ms:
            row["quantum_ms_median"] = float(np.median(quanta_ms))
            row["quantum_ms_p999"] = float(np.quantile(quanta_ms, 0.999))
        rows[name] = row
    return rows


@contextmanager
def _timed(name: str) -> Iterator[list[float]]:
    """Yield a list that gets the processor time of each call of a function that drives to a goal use, ms."""
    function, spent_ms = getattr(goal_drive, name), list[float]()

    def timed(*arguments: Any) -> Any:
        begin_ns = time.thread_time_ns()
        result = function(*arguments)
        spent_ms.append(1e-6 * (time.thread_time_ns() - begin_ns))
        return result

    setattr(goal_drive, name, timed)
    try:
        yield spent_ms
    finally:
        setattr(goal_drive, name, function)


def trials_of(lasers: Sequence[Path], pairs: int, first: int) -> list[Trial]:
    """Return drives in buildings, evenly shared, or without any in random rooms.

    Parameters
    ----------
    lasers : sequence of Path
        CARMEN logs.
    pairs : int
        Number of drives.
    first : int
        Seed of the first.
    """
    settings = load_settings("hallway")
    if not lasers:
        return [random_trial(seed, settings) for seed in range(first, first + pairs)]
    shares = [pairs // len(lasers) + (k < pairs % len(lasers)) for k in range(len(lasers))]
    return [
        trial
        for path, share in zip(lasers, shares, strict=True)
        for trial in laser_trials(path, share, settings, first)
    ]
