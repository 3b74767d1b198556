"""The cost of a firing in a large map: halls of more and more drums, driven through once and back."""

from __future__ import annotations

import gc
import math
import time
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from typing import Final

import numpy as np
from rich.table import Table

from config.settings import Settings
from config.world import DrumConfig, WorldConfig
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.firing_pattern import firing_pattern, sensors
from drivers.messages import Firing, Pose
from perception.bayes.memory.state import CircleTrack
from perception.bayes.tracks.archived_tracks import archived_dtype
from perception.pipeline import Perception
from runtime.simulation.long_hall import ACOUSTICS, START, long_hall_drums

STEP_M: Final = 0.025
"""Way from firing to firing: .5 m/s at 20 Hz."""
BEYOND_M: Final = 2.0
GATE_M: Final = 0.1
HEARD_M: Final = 12.0
"""Drums farther away than this are left out of the emulated scene; the sensors' range is 7.8 m."""
PIECE_M: Final = 10.0
"""The hall is emulated in pieces of this length, because the emulator looks at every drum of its scene."""
LAST: Final = 4000
"""Firings at the end of a drive from which the cost is taken, where the map is largest."""

Figures = dict[str, float]


def pieces(drums: Sequence[DrumConfig], begin_m: float, end_m: float) -> Iterator[tuple[WorldConfig, list[float]]]:
    """Yield the drums near each piece of a way along the hall, and the places of the firings on it, m."""
    count = max(1, math.ceil(abs(end_m - begin_m) / PIECE_M))
    for low, high in pairwise(np.linspace(begin_m, end_m, count + 1).tolist()):
        heard = [d for d in drums if min(low, high) - HEARD_M < d.x_m < max(low, high) + HEARD_M]
        firings = max(1, round(abs(high - low) / STEP_M))
        places = np.linspace(low, high, firings, endpoint=False).tolist()
        yield WorldConfig(drum=tuple(heard), acoustics=ACOUSTICS), places


def drive(settings: Settings, a_side: int, seed: int) -> Figures:
    """Drive through a hall and back; return what was found and what a firing took.

    Parameters
    ----------
    settings : Settings
        Ring, models and perception.
    a_side : int
        Drums on each side.
    seed : int
        Of their places and of the noise.
    """
    drums = long_hall_drums(seed, a_side)
    ring, perception = settings.ring, Perception(settings.ring, settings.models, settings.perception)
    begin_m, end_m = START.x_m, max(drum.x_m for drum in drums) + BEYOND_M
    pattern = firing_pattern(ring)
    took_ms, rng, k, robot_s = list[float](), np.random.default_rng(seed), 0, 0.0
    gc.collect()
    gc.disable()
    try:
        for begin, end in ((begin_m, end_m), (end_m, begin_m)):
            for near, places in pieces(drums, begin, end):
                sonar = Sonar(ring, compile_scene(near), near.acoustics, rng)
                for x in places:
                    pose = Pose(x, 0.0, 0.0)
                    fired = sensors(pattern.masks[k % len(pattern.masks)])
                    firing = Firing(robot_s, pose, 0.0, sonar.fire(pose, 0.0, fired))
                    begin_s = time.thread_time()
                    perception.observe(firing)
                    while perception.can_refine and perception.refine():
                        pass
                    perception.near_objects()
                    took_ms.append(1e3 * (time.thread_time() - begin_s))
                    k, robot_s = k + 1, robot_s + pattern.step_period_s
    finally:
        gc.enable()
    return figures_of(perception, drums, took_ms)


def figures_of(perception: Perception, drums: Sequence[DrumConfig], took_ms: Sequence[float]) -> Figures:
    """Return the figures at the end of a drive.

    Parameters
    ----------
    perception : Perception
        After the drive.
    drums : sequence of DrumConfig
        The truth.
    took_ms : sequence of float
        What each firing took, ms.
    """
    objects = perception.objects()
    places = np.array([(drum.x_m, drum.y_m) for drum in drums])
    seen = np.array([(o.x, o.y) for o in objects]).reshape(-1, 2)
    errors = [float(np.hypot(*(places - one).T).min()) for one in seen]
    found = sum(float(np.hypot(*(seen - one).T).min(initial=math.inf)) <= GATE_M for one in places)
    hits = sum(error <= GATE_M for error in errors)
    return {
        "drums": len(drums),
        "found": found,
        "false": len(objects) - hits,
        "twice": hits - found,
        "archived": perception.counts.archived,
        "max_m": max((e for e in errors if e <= GATE_M), default=math.nan),
        "p50_ms": float(np.percentile(took_ms[-LAST:], 50)),
        "p99_ms": float(np.percentile(took_ms[-LAST:], 99)),
        "bytes": archived_dtype(CircleTrack).itemsize,
    }


def measure(settings: Settings, drums: Sequence[int], seed: int, report: Callable[[str], None]) -> list[Figures]:
    """Return the figures of each hall.

    Parameters
    ----------
    settings : Settings
        Ring, models and perception.
    drums : sequence of int
        Numbers of drums.
    seed : int
        Of their places.
    report : callable
        Called with a line on what is running.
    """
    rows = []
    drive(settings, 2, seed)
    for count in drums:
        report(f"map: a hall of {count} drums")
        rows.append(drive(settings, max(1, count // 2), seed))
    return rows


def map_table(rows: Sequence[Figures]) -> Table:
    """Return the table: a row for each hall."""
    table = Table(title="halls of drums, driven through once and back; a firing's thread time", title_justify="left")
    for column in rows[0]:
        table.add_column(column, justify="right")
    for row in rows:
        table.add_row(*(f"{cell}" if isinstance(cell, int) else f"{cell:.3g}" for cell in row.values()))
    return table
