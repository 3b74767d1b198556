"""The report page of a run: Table 2, figures, timing, serial link, modes, stop reasons and settings."""

from __future__ import annotations

import math
from html import escape
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from config.files import utf8
from config.units import FOOT_M
from drivers.messages import Pose
from perception.detected_object import DetectedObject
from runtime import VERSION
from runtime.analysis.plots.figure_files import styled, svg_of
from runtime.analysis.plots.layers import match_to_truth
from runtime.analysis.plots.paper_figures import counted, paper_figures, pictures
from runtime.analysis.plots.run_history import history_figure
from runtime.analysis.report.html_parts import note, section, settings_list, table, tile
from runtime.analysis.report.inline_svg import inlined
from runtime.analysis.report.stylesheet import CSS
from runtime.analysis.timeline import Timeline
from runtime.simulation.evaluation import DrumRow
from runtime.simulation.open_loop import BoxRow, match_objects
from runtime.support.length_format import Units, format_length, format_point

LOG_SHOWN: Final = 40
STOPS: Final = MappingProxyType(
    {
        "budget": "the time for it was over",
        "quota": "as many quanta as allowed",
        "converged": "nothing is to gain",
        "nothing": "nothing was left to improve",
    }
)
"""What ended the refinement of a cycle, in words."""
CAPTIONS: Final = MappingProxyType(
    {
        "raw": "Every echo as the arc on which its reflection may lie.",
        "segments": "Outline segments, as on the page: tangents to the arcs of two readings of one sensor.",
        "clusters": "Clusters of outline segments by minimum distance, as rectangles with an X at the centre.",
        "grid": "The evidence grid around the robot at the end: what each cell has answered, from any direction.",
        "path": "Where the robot was by odometry, dashed, and as known at the end, in odometry's frame of the end.",
        "models": "Models at their matched poses and walls from end to end, over the true world if it is known.",
    }
)


def run_page(timeline: Timeline, units: Units) -> str:
    """Return the page as one HTML text that refers to nothing outside itself."""
    name = escape(utf8(timeline.path.name))
    body = "".join(
        (
            _head(timeline, units),
            section("Objects", _table_2(timeline, units), _others(timeline, units)),
            section("Walls", _walls(timeline, units)),
            section("Figures", _pictures(timeline, units)),
            section("Bookmarks", *_bookmarks(timeline, units)),
            section("Timing", *_timing(timeline)),
            section("Link", *_line(timeline)),
            section("Modes and stop reasons", *_modes(timeline)),
            section("Log: warnings and errors", _log(timeline)),
            section("Made by", _made_by(timeline)),
            section("Settings", settings_list(timeline.settings)),
        )
    )
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{name} · echolocate</title>'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<meta name="generator" content="echolocate {escape(VERSION)}"><style>{CSS}</style></head>'
        f"<body><main>{body}</main></body></html>\n"
    )


def _match_truth(timeline: Timeline) -> tuple[list[DrumRow], list[BoxRow], int] | None:
    """Return how objects match the true world: drums, boxes and polygons, how many are false; None without one."""
    if timeline.world is None:
        return None
    placed = [timeline.start.compose(Pose(o.x, o.y, o.theta)) for o in timeline.objects]
    seen = [
        DetectedObject(o.model, p.x, p.y, p.theta, o.sigma, o.support, o.score)
        for o, p in zip(timeline.objects, placed, strict=True)
    ]
    return match_objects(timeline.world, seen, timeline.settings.models)


def _head(timeline: Timeline, units: Units) -> str:
    """Return the title, the numbers that matter most, and the notes."""
    method = {"bayes": "Bayesian method", "paper": "paper's method"}[timeline.settings.perception.method]
    when = "" if timeline.started is None else f"{timeline.started}, "
    tiles = []
    if (matches := _match_truth(timeline)) is not None:
        drums, boxes, false = matches
        rows = [*drums, *boxes]
        errors = [row["error"] for row in rows if row["error"] is not None]
        tiles.append(tile(f"{len(errors)} of {len(rows)}", f"objects found, {false} false"))
        if errors:
            tiles.append(tile(f"{format_length(sum(errors) / len(errors), units, 3)} {units}", "mean error"))
            tiles.append(tile(f"{format_length(max(errors), units, 3)} {units}", "worst error"))
    else:
        tiles.append(tile(str(len(timeline.objects)), "objects recognised"))
    tiles.append(tile(str(len(timeline.walls)), "walls recognised"))
    back = int(np.isfinite(timeline.echoes["range_m"]).sum())
    tiles.append(tile(f"{back:,}", f"echoes of {len(timeline.echoes):,} readings"))
    tiles.append(tile(f"{timeline.cycles:,}", "cycles" if timeline.modes else "firings"))
    tiles.append(tile(f"{timeline.seconds:.1f} s", "duration"))
    about = escape(f"{when}{method}, version {timeline.versions.get('echolocate', VERSION)}")
    notes = "".join(note(text, bad=True) for text in timeline.notes)
    title = escape(utf8(timeline.path.stem))
    return f'<h1>{title}</h1><p class="sub">{about}</p><div class="tiles">{"".join(tiles)}</div>{notes}'


def _table_2(timeline: Timeline, units: Units) -> str:
    """Return the paper's Table 2 of this run, with errors."""
    if (matches := _match_truth(timeline)) is None:
        return note("The true world is not known, so there are no errors.")
    drums, boxes, false = matches
    heads = ["", f"truth ({units})", f"estimate ({units})", f"error ({units})"]
    of_boxes = 0 if timeline.world is None else len(timeline.world.box)
    rows = []
    for what, number, row in [
        *(("drum", i, row) for i, row in enumerate(drums, 1)),
        *(("box", i, row) for i, row in enumerate(boxes[:of_boxes], 1)),
        *(("polygon", i, row) for i, row in enumerate(boxes[of_boxes:], 1)),
    ]:
        estimate, error = row["estimate"], row["error"]
        rows.append(
            [
                f"{what} {number}",
                format_point(*row["truth"], units),
                "not found" if estimate is None else format_point(*estimate, units),
                "" if error is None else format_length(error, units, 3),
            ]
        )
    notes_below = note(
        f"As the paper's Table 2, in world coordinates. {false} objects recognised where there is none."
    )
    numbers = paper_figures(timeline)
    if numbers is not None and numbers[0] == 6:
        mean, worst = (format_length(FOOT_M * feet, units, 3) for feet in (0.249, 0.349))
        notes_below += note(
            f"The paper's own Table 2 has a mean error of {mean} {units} and a worst of {worst} {units}."
        )
    return table(heads, rows) + notes_below


def _others(timeline: Timeline, units: Units) -> str:
    """Return the table of all objects."""
    if not timeline.objects:
        return note("Nothing was recognised.")
    heads = ["", f"x ({units})", f"y ({units})", "heading (°)", f"σ ({units})", "support", "score"]
    known = match_to_truth(timeline.objects, timeline)
    names = [known[j].name if j in known else str(o.number or j + 1) for j, o in enumerate(timeline.objects)]
    rows = [
        [
            f"{name}, {o.model}",
            format_length(o.x, units, 3),
            format_length(o.y, units, 3),
            f"{math.degrees(math.remainder(o.theta, math.tau)):.0f}",
            format_length(o.sigma, units, 4),
            str(o.support),
            f"{o.score:.3f}",
        ]
        for name, o in zip(names, timeline.objects, strict=True)
    ]
    return note("As the run itself reports them, in the odometry's frame, named as in the figure:") + table(
        heads, rows
    )


def _walls(timeline: Timeline, units: Units) -> str:
    """Return the table of the walls, and what there is of polylines."""
    heads = [
        "",
        f"from ({units})",
        f"to ({units})",
        f"length ({units})",
        "σ of its direction (°)",
        "support",
        "score",
    ]
    rows = [
        [
            f"{wall.number}, {wall.model}",
            format_point(x1, y1, units),
            format_point(x2, y2, units),
            format_length(math.hypot(x2 - x1, y2 - y1), units),
            f"{math.degrees(wall.sigma_theta or 0.0):.2f}",
            str(wall.support),
            f"{wall.score:.3f}",
        ]
        for wall in timeline.walls
        for x1, y1, x2, y2 in [wall.ends or (0.0, 0.0, 0.0, 0.0)]
    ]
    said = "Each straight piece between openings, in the odometry's frame, with the number that it has on the page:"
    listed = note(said) + table(heads, rows) if rows else ""
    if timeline.polylines:
        length_m = sum(one.length_m for one in timeline.polylines)
        listed += note(
            f"What is not straight: {counted(len(timeline.polylines), 'polyline')}, "
            f"{format_length(length_m, units)} {units} together, drawn thinner than walls in the figure."
        )
    return listed


def _pictures(timeline: Timeline, units: Units) -> str:
    """Return the figures."""
    with styled(text_as_text=True):
        drawn = {
            **{name: (svg_of(figure), CAPTIONS[name]) for name, figure in pictures(timeline, units).items()},
            "history": (
                svg_of(history_figure(timeline, units)),
                "Objects known, their errors, and the time between cycles.",
            ),
        }
    figures = "".join(
        f"<figure>{inlined(svg, name, caption)}<figcaption>{escape(caption)}</figcaption></figure>"
        for name, (svg, caption) in drawn.items()
    )
    return f'<div class="figures">{figures}</div>'


def _bookmarks(timeline: Timeline, units: Units) -> list[str]:
    """Return the table of the bookmarks; nothing without any."""
    rows = []
    for number, mark in enumerate(timeline.bookmarks, 1):
        there = None if mark.pose is None else timeline.start.compose(mark.pose)
        rows.append(
            [
                str(number),
                f"{mark.t_s:.2f} s",
                "" if there is None else format_point(there.x, there.y, units),
                mark.text,
            ]
        )
    return [table(["", "after", f"robot at ({units})", "text"], rows, text=True)] if rows else []


def _timing(timeline: Timeline) -> list[str]:
    """Return the spread of times that the run's summary has, late cycles, and why refinement ended."""
    summary = timeline.summary or {}
    rows: list[tuple[str, list[float]]] = []
    parts = []
    timing: dict[str, Any] = summary.get("timing", {})
    for name, spread in timing.get("phases", {}).items():
        rows.append((str(name), _spread(spread)))
    for name, spread in timing.get("callbacks", {}).items():
        rows.append((f"between cycles: {name}", _spread(spread)))
    for name, label in (("late", "lateness of a cycle's start"), ("echo_wait", "wait of an echo for its cycle")):
        if name in timing:
            rows.append((label, _spread(timing[name])))
    if not timing and "cycle_us" in summary:
        rows.append(("a whole cycle", _spread(summary["cycle_us"])))
    if rows:
        heads = ["ms", "median", "p99", "p99.9", "worst"]
        parts.append(table(heads, [[name, *("" if math.isnan(v) else f"{v:.2f}" for v in vs)] for name, vs in rows]))
    else:
        parts.append(note("The file has no summary of the run: it was cut off, or this is a ring log."))
    if timeline.cycle_gaps_s:
        q = 1e3 * np.quantile(timeline.cycle_gaps_s, [0.0, 0.5, 0.99, 1.0])
        what = "cycle to cycle" if timeline.modes else "firing to firing"
        parts.append(note(f"From {what}, ms: least {q[0]:.1f}, median {q[1]:.1f}, p99 {q[2]:.1f}, most {q[3]:.1f}."))
    if "late" in summary:
        by = ", ".join(f"{fault} ({count})" for fault, count in timing.get("faults", {}).items())
        whose = f"; caused by {by}" if by else ""
        parts.append(note(f"{summary['late']} cycles late, {summary.get('missed', 0)} missed{whose}."))
    if timeline.refinement_stops:
        causes = ", ".join(
            f"{STOPS.get(cause, cause)} {count:,}" for cause, count in sorted(timeline.refinement_stops.items())
        )
        parts.append(note(f"Cycles by what ended their refinement: {causes}."))
    return parts


def _spread(spread: dict[str, float]) -> list[float]:
    """Return median, p99, p99.9 and worst in ms, of µs; NaN for what is not known."""
    return [1e-3 * spread.get(key, math.nan) for key in ("p50", "p99", "p999", "max")]


def _line(timeline: Timeline) -> list[str]:
    """Return the counts of the frames on the line; nothing of a run without them."""
    link = (timeline.summary or {}).get("link")
    counts = timeline.counts
    rows = []
    if link is not None:
        rows.append(["counted during the run", *(f"{link[key]:,}" for key in ("frames", "bad", "lost"))])
    if counts is not None:
        rows.append(["in the recorded bytes", *(f"{n:,}" for n in (counts.frames, counts.bad, counts.lost))])
    return [table(["", "frames", "bad", "lost"], rows)] if rows else []


def _modes(timeline: Timeline) -> list[str]:
    """Return the reasons of stops and the table of the modes; nothing of a ring log."""
    reasons = [str(reason) for reason in (timeline.summary or {}).get("stop_reasons", [])]
    if not reasons:
        reasons = [m.reason for m in timeline.modes if m.mode in {"SAFE_STOP", "FAULT"} and m.reason]
    if not timeline.modes:
        return []
    rows = [[f"{m.t_s:.2f} s", m.mode, m.reason or ""] for m in timeline.modes]
    notes_below = note("The run has no safety stop.") if not reasons else "".join(note(r, bad=True) for r in reasons)
    return [notes_below, table(["after", "mode", "reason"], rows, text=True)]


def _log(timeline: Timeline) -> str:
    said = [line for line in timeline.log if line.level not in {"info", "debug"}]
    rows = [[f"{line.t_s:.2f} s", line.level, line.text] for line in said[:LOG_SHOWN]]
    more = note(f"and {len(said) - LOG_SHOWN} more") if len(said) > LOG_SHOWN else ""
    return table(["after", "level", "message"], rows, text=True) + more if rows else ""


def _made_by(timeline: Timeline) -> str:
    return table(["", ""], [[k, v] for k, v in timeline.versions.items()], text=True) if timeline.versions else ""
