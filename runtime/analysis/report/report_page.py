"""The page of a run: Table 2 and its errors, pictures, timing, line, modes and stop reasons, settings."""

from __future__ import annotations

import math
from html import escape
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from config.units import FOOT_M
from drivers.messages import Pose
from perception.detected_object import DetectedObject
from runtime import VERSION
from runtime.analysis.plots.figure_files import styled, svg_of
from runtime.analysis.plots.layers import stand_for
from runtime.analysis.plots.paper_figures import paper_figures, pictures
from runtime.analysis.plots.run_history import course
from runtime.analysis.report.html_parts import note, section, settings_list, table, tile
from runtime.analysis.report.inline_svg import inlined
from runtime.analysis.report.stylesheet import CSS
from runtime.analysis.text_tables import Units, length, place
from runtime.analysis.trace import RANGE, Trace
from runtime.simulation.evaluation import DrumRow
from runtime.simulation.open_loop import BoxRow, judge

LOG_SHOWN: Final = 40
CAPTIONS: Final = MappingProxyType(
    {
        "raw": "Every echo as the arc from which it may have come.",
        "segments": "Outline segments: tangents to the arcs of two readings of one sensor.",
        "clusters": "Clusters of outline segments by minimum distance, as rectangles with an X at the centre.",
        "models": "Models where they were matched, over what stood there where that is known.",
    }
)


def page(trace: Trace, units: Units) -> str:
    """Return the page as one text of HTML that refers to nothing outside itself."""
    name = escape(trace.path.name)
    body = "".join(
        (
            _head(trace, units),
            section("Objects", _table_2(trace, units), _others(trace, units)),
            section("Pictures", _pictures(trace, units)),
            section("Bookmarks", *_bookmarks(trace, units)),
            section("Timing", *_timing(trace)),
            section("Line", *_line(trace)),
            section("Modes and stop reasons", *_modes(trace)),
            section("Log: warnings and errors", _log(trace)),
            section("Made by", _made_by(trace)),
            section("Settings", settings_list(trace.settings)),
        )
    )
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{name} · echolocate</title>'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<meta name="generator" content="echolocate {escape(VERSION)}"><style>{CSS}</style></head>'
        f"<body><main>{body}</main></body></html>\n"
    )


def _judged(trace: Trace) -> tuple[list[DrumRow], list[BoxRow], int] | None:
    if trace.world is None:
        return None
    placed = [trace.start.compose(Pose(o.x, o.y, o.theta)) for o in trace.objects]
    seen = [
        DetectedObject(o.model, p.x, p.y, p.theta, o.sigma, o.support, o.score)
        for o, p in zip(trace.objects, placed, strict=True)
    ]
    return judge(trace.world, seen, trace.settings.models)


def _head(trace: Trace, units: Units) -> str:
    method = {"bayes": "Bayesian method", "paper": "paper's method"}[trace.settings.perception.method]
    when = "" if trace.started is None else f"{trace.started}, "
    tiles = []
    if (judged := _judged(trace)) is not None:
        drums, boxes, false = judged
        rows = [*drums, *boxes]
        errors = [row["error"] for row in rows if row["error"] is not None]
        tiles.append(tile(f"{len(errors)} of {len(rows)}", f"things found, {false} false"))
        if errors:
            tiles.append(tile(f"{length(sum(errors) / len(errors), units, 3)} {units}", "mean error"))
            tiles.append(tile(f"{length(max(errors), units, 3)} {units}", "worst error"))
    else:
        tiles.append(tile(str(len(trace.objects)), "objects recognised"))
    back = int(np.isfinite(trace.echoes[:, RANGE]).sum())
    tiles.append(tile(f"{back:,}", f"echoes of {len(trace.echoes):,} readings"))
    tiles.append(tile(f"{trace.cycles:,}", "cycles" if trace.modes else "firings"))
    tiles.append(tile(f"{trace.seconds:.1f} s", "long"))
    about = escape(f"{when}{method}, version {trace.made_by.get('echolocate', VERSION)}")
    notes = "".join(note(text, bad=True) for text in trace.notes)
    title = escape(trace.path.stem)
    return f'<h1>{title}</h1><p class="sub">{about}</p><div class="tiles">{"".join(tiles)}</div>{notes}'


def _table_2(trace: Trace, units: Units) -> str:
    """Return the paper's Table 2 of this run, with errors."""
    if (judged := _judged(trace)) is None:
        return note("What stood there is not known, so no error is told.")
    drums, boxes, false = judged
    heads = ["", f"truth ({units})", f"estimate ({units})", f"error ({units})"]
    rows = []
    for what, number, row in [
        *(("drum", i, row) for i, row in enumerate(drums, 1)),
        *(("box", i, row) for i, row in enumerate(boxes, 1)),
    ]:
        estimate, error = row["estimate"], row["error"]
        rows.append(
            [
                f"{what} {number}",
                place(*row["truth"], units),
                "not found" if estimate is None else place(*estimate, units),
                "" if error is None else length(error, units, 3),
            ]
        )
    told = note(f"As the paper's Table 2, in world coordinates. {false} recognised where nothing of the kind stands.")
    numbers = paper_figures(trace)
    if numbers is not None and numbers[0] == 6:
        mean, worst = (length(FOOT_M * feet, units, 3) for feet in (0.249, 0.349))
        told += note(f"The paper's own Table 2 has a mean error of {mean} {units} and a worst of {worst} {units}.")
    return table(heads, rows) + told


def _others(trace: Trace, units: Units) -> str:
    if not trace.objects:
        return note("Nothing was recognised.")
    heads = ["", f"x ({units})", f"y ({units})", "heading (°)", f"σ ({units})", "support", "score"]
    known = stand_for(trace.objects, trace)
    names = [known[j].name if j in known else str(j + 1) for j in range(len(trace.objects))]
    rows = [
        [
            f"{name}, {o.model}",
            length(o.x, units, 3),
            length(o.y, units, 3),
            f"{math.degrees(o.theta):.0f}",
            length(o.sigma, units, 4),
            str(o.support),
            f"{o.score:.3f}",
        ]
        for name, o in zip(names, trace.objects, strict=True)
    ]
    return note("What the run itself reports, in the odometry's frame, named as in the picture:") + table(heads, rows)


def _pictures(trace: Trace, units: Units) -> str:
    with styled(text_as_text=True):
        drawn = {
            **{name: (svg_of(figure), CAPTIONS[name]) for name, figure in pictures(trace, units).items()},
            "course": (
                svg_of(course(trace, units)),
                "Objects known, their errors, and the cycles' rhythm.",
            ),
        }
    figures = "".join(
        f"<figure>{inlined(svg, name, caption)}<figcaption>{escape(caption)}</figcaption></figure>"
        for name, (svg, caption) in drawn.items()
    )
    return f'<div class="figures">{figures}</div>'


def _bookmarks(trace: Trace, units: Units) -> list[str]:
    rows = []
    for number, mark in enumerate(trace.bookmarks, 1):
        there = None if mark.pose is None else trace.start.compose(mark.pose)
        rows.append(
            [str(number), f"{mark.t_s:.2f} s", "" if there is None else place(there.x, there.y, units), mark.text]
        )
    return [table(["", "after", f"robot at ({units})", "what"], rows, text=True)] if rows else []


def _timing(trace: Trace) -> list[str]:
    summary = trace.summary or {}
    rows: list[tuple[str, list[float]]] = []
    parts = []
    timing: dict[str, Any] = summary.get("timing", {})
    for name, spread in timing.get("phases", {}).items():
        rows.append((str(name), _spread(spread)))
    for name, spread in timing.get("callbacks", {}).items():
        rows.append((f"between cycles: {name}", _spread(spread)))
    for name, told in (("late", "a cycle begins after it is due by"), ("echo_wait", "an echo waits for its cycle")):
        if name in timing:
            rows.append((told, _spread(timing[name])))
    if not timing and "cycle_us" in summary:
        rows.append(("a whole cycle", _spread(summary["cycle_us"])))
    if rows:
        heads = ["ms", "median", "p99", "p99.9", "worst"]
        parts.append(table(heads, [[name, *("" if math.isnan(v) else f"{v:.2f}" for v in vs)] for name, vs in rows]))
    else:
        parts.append(note("The run's own books are not in the file: it was cut off, or this is a ring log."))
    if trace.gaps_s:
        q = 1e3 * np.quantile(trace.gaps_s, [0.0, 0.5, 0.99, 1.0])
        what = "cycle to cycle" if trace.modes else "firing to firing"
        parts.append(note(f"From {what}, ms: least {q[0]:.1f}, median {q[1]:.1f}, p99 {q[2]:.1f}, most {q[3]:.1f}."))
    if "late" in summary:
        by = ", ".join(f"{culprit} ({count})" for culprit, count in timing.get("faults", {}).items())
        whose = f"; by fault of {by}" if by else ""
        parts.append(note(f"{summary['late']} cycles late, {summary.get('missed', 0)} missed{whose}."))
    if trace.stops:
        causes = ", ".join(f"{cause} {count}" for cause, count in sorted(trace.stops.items()))
        parts.append(note(f"Refinement ended by: {causes}."))
    return parts


def _spread(spread: dict[str, float]) -> list[float]:
    return [1e-3 * spread.get(key, math.nan) for key in ("p50", "p99", "p999", "max")]


def _line(trace: Trace) -> list[str]:
    link = (trace.summary or {}).get("link")
    counts = trace.counts
    rows = []
    if link is not None:
        rows.append(["as the run counted", *(f"{link[key]:,}" for key in ("frames", "bad", "lost"))])
    if counts is not None:
        rows.append(["in the recorded bytes", *(f"{n:,}" for n in (counts.frames, counts.bad, counts.lost))])
    return [table(["", "frames", "bad", "lost"], rows)] if rows else []


def _modes(trace: Trace) -> list[str]:
    reasons = [str(reason) for reason in (trace.summary or {}).get("stop_reasons", [])]
    if not reasons:
        reasons = [m.reason for m in trace.modes if m.mode in {"SAFE_STOP", "FAULT"} and m.reason]
    if not trace.modes:
        return []
    rows = [[f"{m.t_s:.2f} s", m.mode, m.reason or ""] for m in trace.modes]
    told = note("Never stopped for a reason.") if not reasons else "".join(note(r, bad=True) for r in reasons)
    return [told, table(["after", "mode", "why"], rows, text=True)]


def _log(trace: Trace) -> str:
    said = [line for line in trace.log if line.level not in {"info", "debug"}]
    rows = [[f"{line.t_s:.2f} s", line.level, line.text] for line in said[:LOG_SHOWN]]
    more = note(f"and {len(said) - LOG_SHOWN} more") if len(said) > LOG_SHOWN else ""
    return table(["after", "level", "what"], rows, text=True) + more if rows else ""


def _made_by(trace: Trace) -> str:
    return table(["", ""], [[k, v] for k, v in trace.made_by.items()], text=True) if trace.made_by else ""
