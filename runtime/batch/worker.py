"""What a worker does: make one run of a study and return the figures of its result.

Perception and its compiler are imported when a run begins: a worker first sets its cache of kernels.
"""

from __future__ import annotations

import functools
import math
import time
from pathlib import Path
from statistics import mean
from typing import TYPE_CHECKING, Any, TypeAlias, cast

from rich.console import Console

from config.errors import UserError
from config.load import override_settings
from config.settings import Settings
from config.world import WorldConfig
from runtime import VERSION
from runtime.batch.runs import Run

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from drivers.messages import Firing
    from runtime.cycle.summary import ObjectRow
    from runtime.simulation.evaluation import DrumRow
    from runtime.simulation.open_loop import BoxRow
    from runtime.simulation.scene_names import SceneName
    from runtime.timing.cycle_stats import Quantiles

Row: TypeAlias = dict[str, Any]
"""The result of a run: key, version of the program, status, reason of a failure, elapsed time, figures."""


def run_one(run: Run) -> Row:
    """Make a run and return its row.

    A drive that did not arrive is a result as well: its status is ``failed``.

    Raises
    ------
    UserError
        A recording cannot be read here.
    """
    settings = prepared_settings(run.settings)
    started_s = time.perf_counter()
    row: Row = {"key": run.key, "version": VERSION, "status": "done", "reason": None}
    if run.kind == "world":
        try:
            row |= drive_figures(settings, run.seed or 0)
        except UserError as error:
            row |= {"status": "failed", "reason": str(error)}
    elif run.kind == "scene":
        row |= scene_figures(settings, run.subject, run.seed or 0)
    else:
        row |= recording_figures(settings, run)
    return row | {"elapsed_s": time.perf_counter() - started_s}


@functools.lru_cache(maxsize=64)
def prepared_settings(text: str) -> Settings:
    """Return settings from JSON, with their kernels loaded in this process: once for all seeds."""
    from runtime.support.kernel_warmup import prepare_kernels

    settings = Settings.model_validate_json(text)
    prepare_kernels(settings, Console(quiet=True))
    return settings


def drive_figures(settings: Settings, seed: int) -> Row:
    """Return the figures of a drive through the settings' world.

    Raises
    ------
    UserError
        The robot did not arrive, or there is no world.
    """
    from runtime.simulation.evaluation import run_seed

    if settings.world is None:
        raise UserError("there is no world to drive through")
    outcome = run_seed(settings, settings.world, seed)
    return {
        "objects": len(outcome.end["objects"]),
        "virtual_s": outcome.virtual_s,
        **truth_figures(outcome.rows, outcome.false),
        **cycle_figures(outcome.cycle_us),
    }


def scene_figures(settings: Settings, scene: str, seed: int) -> Row:
    """Return the figures of perception in all halls of a scene."""
    from runtime.simulation.open_loop import run_scene, summarise_scene

    name = cast("SceneName", scene)  # `expand` has checked it
    outcome = summarise_scene(name, run_scene(settings, name, seed), settings.models)
    figures = truth_figures([*outcome["drums"], *outcome["boxes"]], outcome["false"])
    return {
        "objects": figures["found"] + figures["false"],
        "inside_95": outcome["inside_95"],
        **figures,
        **cycle_figures(outcome["cycle_us"]),
    }


def recording_figures(settings: Settings, run: Run) -> Row:
    """Return the figures of a replay; without a true world only those that need none.

    Parameters
    ----------
    settings : Settings
        Of a ring log; a recording (MCAP) contains its own.
    run : Run
        The file, what differs from the settings in it, and the true world.

    Raises
    ------
    UserError
        The file cannot be read.
    """
    from runtime.analysis.comparison import run_under
    from runtime.analysis.export.ring_log_export import recorded_firings
    from runtime.analysis.prediction import predicted_nat, withhold
    from runtime.recording.conventions.reading import open_ring_log
    from runtime.recording.reader import is_recording, open_recording
    from runtime.recording.ring_log_replay import replay_firings

    path = Path(run.subject)
    world = None if run.truth is None else WorldConfig.model_validate_json(run.truth)
    firings: Iterable[Firing] | None = None
    figures: Row = {"stops": 0}
    if is_recording(path):
        with open_recording(path) as recording:
            settings = override_settings(recording.settings, str(path), run.overrides)
            world = recording.world if world is None else world
            if run.predicts:
                firings = recorded_firings(recording)
            else:
                outcome, cycle_stats = run_under(recording, settings)
                objects, cycle_us = outcome.objects, cycle_stats.cycle_us()
                figures["stops"] = len(outcome.stops)
    else:
        firings = open_ring_log(path, settings)
    if firings is not None:
        if run.predicts:
            firings, withheld = withhold(firings)
        summary = replay_firings(settings, firings)
        objects, cycle_us = summary["objects"], summary["cycle_us"]
        if run.predicts:
            figures["predicted_nat"] = predicted_nat(settings, summary, withheld)
    figures |= {"objects": len(objects), "mean_sigma_m": mean_sigma(objects)}
    if world is not None:
        figures |= map_figures(objects, world, settings)
    return {**figures, **cycle_figures(cycle_us)}


def map_figures(objects: Sequence[ObjectRow], world: WorldConfig, settings: Settings) -> Row:
    """Return how the objects of a recording, whose odometry begins at the world's start, compare with the truth.

    Objects of the world that are none of the models are not looked for; figures are empty if there is no other.
    """
    from drivers.messages import Pose
    from perception.detected_object import DetectedObject
    from runtime.simulation.open_loop import match_objects

    start = Pose(world.start.x_m, world.start.y_m, math.radians(world.start.heading_deg))
    seen = []
    for one in objects:
        at = start.compose(Pose(one["x"], one["y"], one["theta"]))
        seen.append(DetectedObject(one["model"], at.x, at.y, at.theta, one["sigma"], one["support"], one["score"]))
    drums, boxes, false = match_objects(world, seen, settings.models)
    with_boxes = any(model.arc_radius_m is None for model in settings.models)
    rows = [*drums, *(boxes if with_boxes else ())]
    return truth_figures(rows, false) if rows else {}


def truth_figures(rows: Sequence[DrumRow | BoxRow], false: int) -> Row:
    """Return how `rows`, one for each true object, and the number of false objects compare with the truth."""
    errors = [row["error"] for row in rows if row["error"] is not None]
    return {
        "truth": len(rows),
        "found": len(errors),
        "recall": len(errors) / len(rows) if rows else None,
        "f1": 2.0 * len(errors) / (len(rows) + len(errors) + false) if rows else None,
        "false": false,
        "mean_error_m": mean(errors) if errors else None,
        "max_error_m": max(errors, default=None),
    }


def cycle_figures(cycle_us: Quantiles) -> Row:
    """Return what a cycle or a firing took, µs; it depends on the machine and on its other work."""
    return {"cycle_us_p50": cycle_us["p50"], "cycle_us_p99": cycle_us["p99"]}


def mean_sigma(objects: Sequence[ObjectRow]) -> float | None:
    """Return the mean standard deviation of the objects' places, m; None without any."""
    known = [seen["sigma"] for seen in objects if math.isfinite(seen["sigma"])]
    return mean(known) if known else None
