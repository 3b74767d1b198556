"""Bounds of every number in perception's state, checked before the state of a recording's keyframe is restored.

A keyframe comes from a file, and a file may come from anyone. Its state is handed to compiled kernels, which check no
index: one out of range reads or writes the memory of the process. So every integer of the state has a bound here, an
integer without a bound is refused, and floats are finite, because an index may be computed from a float. The bounds
stand here by the ends of the fields' names, not beside the fields: half of the fields are plain arrays of
perception's objects, and perception itself never makes a state that needs the check. The scratch has no bounds:
kernels overwrite it before each use.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Any, Final, NamedTuple

import numpy as np

from config.settings import Settings
from perception.bayes.archived_tracks import READINGS_KEPT as READINGS_ARCHIVED
from perception.bayes.elements import (
    BEARING_BINS,
    BUCKETS,
    MAX_POLYGONS,
    POLYGON_BEARING_BINS,
    POLYGON_BIN_CAPACITY,
)
from perception.bayes.pinned_segments import PINS_MAX
from perception.bayes.polygon_job import NO_JOB, REFINEMENT
from perception.bayes.polygon_likelihood import AXES
from perception.bayes.polygon_parameters import LATTICE_ATTEMPTS
from perception.bayes.pose_restarts import LATTICE
from perception.bayes.scratch import POLYGON
from perception.bayes.settings_record import CIRCLES_MAX, NOISES, POLYGONS_MAX
from perception.bayes.state import CONFIRMED, ESTABLISHED, FREE, PLACED
from perception.bayes.wall_records import IS_KNOWN, IS_TAKEN, MAX_WALLS, SPANS_MAX, WALL_BIN_M, WALL_BINS
from perception.localization.background import HEARD_MIN
from perception.localization.known_room import IDLE, STATUSES, WEIGHING
from perception.localization.landmark_ranges import STRAY_MAX, STRAY_MIN
from perception.localization.landmark_state import LANDMARKS_MAX
from perception.localization.map_heading import FIRST_FIRINGS
from perception.localization.pose_grid import NONE as NO_QUANTUM
from perception.localization.pose_grid import PROFILES_MAX, READINGS_MAX
from perception.localization.pose_particles import HYPOTHESES_MAX
from perception.localization.pose_starts import STARTS_MAX
from perception.localization.pose_track import QUANTA as QUANTA_OF_HYPOTHESIS
from perception.paper.outline_map import PINNED
from perception.paper.parameters import PINNED_SHARE_MAX, PLACEMENTS_MAX, READINGS_KEPT
from perception.sensor_memory import SETS_MAX
from perception.sensor_report import CROSSTALK, FAILING, SILENT, STUCK
from perception.snapshot import GROWING, Snapshot
from perception.vacant_areas import AREAS_MAX


class Bound(NamedTuple):
    """The values that a number may have, both ends included."""

    low: float
    high: float


COUNT: Final = Bound(0, 2**53)
"""Of a count, which becomes an index only after it was reduced to one; it does not overflow for a lifetime."""
SIGNED: Final = Bound(-(2**53), 2**53)
FLAG: Final = Bound(0, 1)
FINITE: Final = Bound(-1e12, 1e12)
"""Of a float; places, times and evidence are far below, and squares and products of a few are finite."""
STEPS: Final = Bound(0, 4096)
"""Of the progress of a polygon's job; its longest stage has a few hundred steps."""
SCALE: Final = Bound(0.5, 2.0)
"""Of a scale by which something is divided."""
SHARE: Final = Bound(0.0, 1.0)
QUANTA: Final = Bound(0, 1000)
"""As `config.settings.BayesConfig.quanta_per_firing`, which a running process may change."""
ITERATIONS: Final = Bound(0, 1_000_000)
"""As `config.settings.RelaxationConfig.iterations_max`, which a running process may change."""
WALL_EXTENT: Final = Bound(-0.5 * WALL_BINS * WALL_BIN_M, 0.5 * WALL_BINS * WALL_BIN_M)
"""Of the ends of a wall's spans, which become indices of its bins."""
JOB_READINGS: Final = POLYGON_BEARING_BINS * POLYGON_BIN_CAPACITY
SCRATCH: Final = "method.memory.state.scratch."
UNHEARD: Final = ("method.memory.state.sensors.last.", "method.memory.state.sensors.crossed.")
"""Readings that are NaN until their sensor has made one."""

_CONSTANTS: Final = (
    "_axes _mounts _half_angle _sensors _segments_min _reach_m sensor_monitor._neighbours "
    "sensor_monitor._tolerance sensor_monitor._near state.sensor_count scratch.attracting_rows _tracker._ring "
    "drift._range_min_m canyon_map.sealed_m"
)
CONSTANTS: Final = frozenset(_CONSTANTS.split())
"""Numbers that the settings give and no cycle changes."""

MAY_BE_INFINITE: Final = frozenset({
    "_sensors.last_m", "before_last_m", "steady_m", "run_m", "stuck_m", "job.best_nat", "_looked_x", "_looked_y",
    "_keyframes._latest", "_keyframes.readings", "_grid._readings", "_grid._found.least", "_echoes._times",
})  # fmt: skip
"""Floats for which an infinity stands for no echo, for no evidence yet, or for no place or time yet."""

_COUNTS: Final = (
    "vacant.last vacant.rows.object canyon_map.numbered canyon_map.firings canyon_map.rows.number "
    "_numbers.last _rejections.total _ring.firings sets_seen bins.count buckets.count number candidates._sizes _turn "
    "changes idle_firings passed_over refinements reservoir unseen clusters.sizes requests_made leaps missed "
    "names_withdrawn near_echoes newest_segment objects_numbered off_stuck outline.numbers outline.total "
    "_sensors.readings "
    "room.firings room.recent_count room.remembered_count rejection_count run_firing run_length segments_held "
    "segments_made segments_numbered "
    "sensors.kept crosses_kept members_sum _archive.circles.count _archive.polygons.count _numbered waiting "
    "drift._arrived drift._checked _tracker.entered _tracker._window_count landmarks.failures landmarks.hits "
    "_keyframes.count _keyframes._firings entered peak_at known_room._window_begin "
    "known_room._search_begin _grid._due _grid._searches"
)
_FLAGS: Final = (
    "_sets has_rested is_named has_gained refines_next is_confirmed has_challenger is_done is_crossed "
    "_is_due is_reported _circles_pending _polygons_pending _polygons_turn _placement_was_last _expected _heard "
    "_steady bins.is_held bins.is_open room.is_loud canyon_map.is_due canyon_map.is_wanted "
    "drift._has_started drift._stands_firm _tracker.is_synchro _map_heading._is_entering sensors.is_known "
    "landmarks.moved _has_fired _is_started _has_stood _is_weighed _is_complete _is_confirmed shares.is_learned"
)

BOUNDS: Final[Mapping[str, Bound]] = MappingProxyType(
    dict.fromkeys(_COUNTS.split(), COUNT)
    | dict.fromkeys(_FLAGS.split(), FLAG)
    | {
        "_grid._count": Bound(0, READINGS_MAX),
        "_grid._found.count": Bound(0, STARTS_MAX),
        "_grid._found.starts.profile": Bound(0, PROFILES_MAX - 1),
        "_grid._profiles": Bound(1, PROFILES_MAX),
        "_grid._quantum": Bound(NO_QUANTUM, COUNT.high),
        "_grid._shares": SHARE,
        "_memory.count": Bound(0, HYPOTHESES_MAX),
        "_step": Bound(0, QUANTA_OF_HYPOTHESIS * HYPOTHESES_MAX - 1),
        "known_room.probability": SHARE,
        "known_room._background.heard_share": Bound(HEARD_MIN, 1.0 - HEARD_MIN),
        "shares._memory.late": SHARE,
        "shares._memory.specular": SHARE,
        "shares._memory.wild": SHARE,
        "shares._memory.beside": SHARE,
        "known_room._stage": Bound(IDLE, WEIGHING),
        "known_room._status": Bound(0, len(STATUSES) - 1),
        "_map_heading._kept": Bound(0, FIRST_FIRINGS),
        "_map_heading._tracker.entered": Bound(0, FIRST_FIRINGS),
        "_rates._variances": Bound(0.0, 1e12),
        "_rates.rate": Bound(0.0, 1e12),
        "_tracker.estimate.count": Bound(0, LANDMARKS_MAX),
        "_tracker.estimate.noise": Bound(0.0, 1e3),
        "_tracker.estimate.odometer_scale": SCALE,
        "_tracker.estimate.range_scale": SCALE,
        "_tracker.estimate.stray": Bound(STRAY_MIN, STRAY_MAX),
        "_extractor._sensors.count": Bound(0, READINGS_KEPT),
        "_extractor._sensors.newest": Bound(0, READINGS_KEPT - 1),
        "_left": QUANTA,
        "_pins.buckets": Bound(0, BUCKETS - 1),
        "_pins.count": Bound(0, PINS_MAX),
        "_polygons_left": QUANTA,
        "_sensors.before_last_set": Bound(0, SETS_MAX - 1),
        "_sensors.faults": Bound(0, STUCK | SILENT | FAILING | CROSSTALK),
        "_sensors.last_set": Bound(0, SETS_MAX - 1),
        "buckets.cell_x": SIGNED,
        "buckets.cell_y": SIGNED,
        "buckets_used": Bound(0, BUCKETS),
        "circles.alternative": Bound(0, CIRCLES_MAX + 1),
        "circles.kind": Bound(0, CIRCLES_MAX - 1),
        "circles.radius": Bound(0.0, 1e3),
        "circles.sides": Bound(0, BEARING_BINS),
        "circles.status": Bound(FREE, ESTABLISHED),
        "corners.first": Bound(0, MAX_WALLS - 1),
        "corners.is_edge": Bound(0, 1),
        "corners.is_used": Bound(0, 1),
        "corners.second": Bound(0, MAX_WALLS - 1),
        "edges.first": Bound(0, MAX_WALLS - 1),
        "edges.is_edge": Bound(0, 1),
        "edges.is_used": Bound(0, 1),
        "edges.second": Bound(0, 1),
        "final_refinements": SIGNED,
        "iterations_left": ITERATIONS,
        "job.lattices": Bound(0, LATTICE_ATTEMPTS),
        "job.next_step": STEPS,
        "job.reading_count": Bound(0, JOB_READINGS),
        "job.reading_step": Bound(0, JOB_READINGS),
        "job.stage": Bound(0, LATTICE),
        "job.track": Bound(0, MAX_POLYGONS - 1),
        "landmarks.radius": Bound(0.0, 1e3),
        "lines.log_odds": Bound(-700.0, 700.0),
        "marks": Bound(0, CONFIRMED | PLACED),
        "moments.mass": Bound(0.0, FINITE.high),
        "noise_level": Bound(0, NOISES - 1),
        "outline.status": Bound(0, PINNED),
        "archived_rows.alternative": Bound(0, CIRCLES_MAX + 1),
        "archived_rows.kept": Bound(0, READINGS_ARCHIVED),
        "archived_rows.kind": Bound(0, CIRCLES_MAX - 1),
        "archived_rows.radius": Bound(0.0, 1e3),
        "archived_rows.sides": Bound(0, BEARING_BINS),
        "archived_rows.status": Bound(FREE, ESTABLISHED),
        "vacant.count": Bound(0, AREAS_MAX),
        "placements.count": Bound(0, PLACEMENTS_MAX),
        "range_m": Bound(0.0, 1e7),
        "recent.is_free": Bound(IS_KNOWN, IS_TAKEN),
        "rejections.what": Bound(0, POLYGON + POLYGONS_MAX - 1),
        "search.rounds_left": Bound(0, 1000),
        "search.trial": Bound(-1, 2 * AXES - 1),
        "spans.end_bin": Bound(0, WALL_BINS),
        "spans.first_bin": Bound(0, WALL_BINS),
        "spans.high": WALL_EXTENT,
        "spans.low": WALL_EXTENT,
        "used_buckets": Bound(0, BUCKETS - 1),
        "walls.is_changed": Bound(0, 1),
        "walls.span_count": Bound(0, SPANS_MAX),
    }
)
"""Bounds by the end of the name. `settings_bounds` has those that depend on the settings."""


def settings_bounds(settings: Settings) -> dict[str, Bound]:
    """Return the bounds that depend on the settings, by the end of the name."""
    perception, models = settings.perception, len(settings.models)
    capacity, clusters = perception.map.capacity, perception.clusters.clusters_max
    polygons = sum(model.arc_radius_m is None for model in settings.models)
    model, polygon = Bound(0, models - 1), Bound(0, max(0, polygons - 1))
    return {
        "_rejections.rows.model": model,
        "candidates._count": Bound(0, clusters),
        "candidates._predecessor": Bound(-1, clusters - 1),
        "_keyframes.counts": Bound(0, len(settings.ring.mounts)),
        "clusters._labels": Bound(-1, clusters - 1),
        "clusters._members": Bound(0, capacity - 1),
        "clusters._offsets": Bound(0, capacity),
        "clusters.count": Bound(0, clusters),
        "job.kind": Bound(NO_JOB, REFINEMENT if polygons else NO_JOB),
        "job.model": polygon,
        "outline.count": Bound(0, capacity),
        "outline.pinned": Bound(0, int(PINNED_SHARE_MAX * capacity)),
        "outline.start": Bound(0, capacity - 1),
        "placements.rows.model": model,
        "polygons.model": polygon,
        "polygons.status": Bound(FREE, ESTABLISHED if polygons else FREE),
        "requests.model": polygon,
        "archived_rows.model": polygon,
    }


def numbers_of(snapshot: Snapshot) -> Iterator[tuple[str, np.ndarray[Any, Any]]]:
    """Yield name and values of every field of every array, inner records included."""
    for name, array in snapshot.items():
        yield from _fields(name, array)


def _fields(name: str, array: np.ndarray[Any, Any]) -> Iterator[tuple[str, np.ndarray[Any, Any]]]:
    if array.dtype.names is None:
        yield name, array
    else:
        for field in array.dtype.names:
            yield from _fields(f"{name}.{field}", array[field])


def end_of(name: str, ends: Mapping[str, Bound] | frozenset[str]) -> str | None:
    """Return the longest of the given dotted ends in which a name ends; None for none of them."""
    words = name.split(".")
    return next((end for k in range(len(words)) if (end := ".".join(words[k:])) in ends), None)


def check_snapshot(snapshot: Snapshot, fresh: Snapshot, settings: Settings) -> None:
    """Check every number of perception's state.

    Parameters
    ----------
    snapshot : Snapshot
        The state, of the same names, dtypes and shapes as `fresh`.
    fresh : Snapshot
        The state in which a run with these settings starts.
    settings : Settings
        In force.

    Raises
    ------
    ValueError
        A number is out of its bounds, or numbers contradict each other.
    """
    bounds = {**BOUNDS, **settings_bounds(settings)}
    numbers = dict(numbers_of(snapshot))
    for (name, values), (_, at_start) in zip(numbers.items(), numbers_of(fresh), strict=True):
        if end_of(name, CONSTANTS) is not None:
            if not np.allclose(values, at_start, rtol=1e-9, atol=1e-9):
                raise ValueError(f"{name} is not what the settings give")
        elif not name.startswith(SCRATCH):
            _check(name, values, bounds)
    _check_contradictions(numbers)


def _check(name: str, values: np.ndarray[Any, Any], bounds: Mapping[str, Bound]) -> None:
    """Check the values of one field."""
    end = end_of(name, bounds)
    if end is None and values.dtype.kind != "f":
        raise ValueError(f"{name} has no bound in runtime.recording.snapshot_bounds")
    low, high = FINITE if end is None else bounds[end]
    if values.dtype.kind == "b":
        values = values.view(np.uint8)  # any other byte than 0 and 1 misleads numpy
    elif name.startswith(UNHEARD):
        values = values[~np.isnan(values)]
    elif end_of(name, MAY_BE_INFINITE) is not None:
        values = values[~np.isinf(values)]
    if values.size and not (values.min() >= low and values.max() <= high):  # also refuses NaN
        wrong = values.max() if values.min() >= low else values.min()
        raise ValueError(f"{name} is {wrong}, expected {low:g} to {high:g}")


def _check_contradictions(numbers: Mapping[str, np.ndarray[Any, Any]]) -> None:
    """Check numbers that are each in their bounds and that would together keep a loop from ending."""
    job = "method.memory.state.job."
    if f"{job}kind" in numbers:
        kind, stage, lattices = (int(numbers[job + name][0]) for name in ("kind", "stage", "lattices"))
        if kind == REFINEMENT and stage == LATTICE and lattices >= LATTICE_ATTEMPTS:
            raise ValueError(f"{job}lattices is {lattices}, but the stage of lattices is not over")
    for count_name in (name for name in numbers if name.startswith("method._archive.") and name.endswith(".count")):
        count, archived = int(numbers[count_name]), numbers[f"{count_name.removesuffix('count')}{GROWING}.number"]
        if len(np.unique(archived[:count])) < count:
            raise ValueError(f"{count_name} is {count}, but not as many objects have a number of their own")
    outline = "method.outline."
    if f"{outline}pinned" in numbers:
        pinned, held = int(numbers[outline + "pinned"]), int(np.count_nonzero(numbers[outline + "status"] == PINNED))
        if pinned != held:
            raise ValueError(f"{outline}pinned is {pinned}, but {held} segments are pinned")
