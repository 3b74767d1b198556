"""Tables for people: the paper's Table 2, objects seen, and how the cycles went."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

from rich.table import Table

from runtime.cli.terminal import page_text
from runtime.simulation.first_fix import EARLY_FIX_M
from runtime.support.length_format import Units, format_length, format_point

if TYPE_CHECKING:
    # The robot's own process has tables too, and shall not load the emulator for them.
    from runtime.cycle.summary import ObjectRow, PolylineRow, PoseRow, RunSummary, WallRow
    from runtime.simulation.budget_sweep import BudgetRow
    from runtime.simulation.drift_trials import DriftRow
    from runtime.simulation.evaluation import DrumRow, Outcome, Spread
    from runtime.simulation.open_loop import BoxRow, SceneOutcome


def table_2(outcome: Outcome, units: Units) -> Table:
    """Return truth, estimate and error of each drum."""
    table = Table(title="Table 2: drums in world coordinates", title_justify="left")
    for heading in ("drum", f"truth ({units})", f"estimate ({units})", f"error ({units})"):
        table.add_column(heading, justify="right")
    for number, row in enumerate(outcome["drums"], 1):
        estimate, error = row["estimate"], row["error"]
        table.add_row(
            str(number),
            format_point(*row["truth"], units),
            "not found" if estimate is None else format_point(*estimate, units),
            "" if error is None else format_length(error, units, 3),
        )
    return table


def boxes_table(outcome: SceneOutcome, units: Units) -> Table:
    """Return truth, estimate and errors of each box."""
    table = Table(title="Boxes in world coordinates", title_justify="left")
    for heading in ("box", f"truth ({units})", f"estimate ({units})", f"error ({units})", "angle error (°)"):
        table.add_column(heading, justify="right")
    for number, row in enumerate(outcome["boxes"], 1):
        estimate, error, angle = row["estimate"], row["error"], row["angle_error"]
        table.add_row(
            str(number),
            format_point(*row["truth"], units),
            "not found" if estimate is None else format_point(*estimate, units),
            "" if error is None else format_length(error, units, 3),
            "" if angle is None else f"{math.degrees(angle):.1f}",
        )
    return table


def outcome_line(outcome: Outcome, units: Units) -> str:
    """Return the experiment in one line."""
    return _summary_line(_found("drums", outcome["drums"]), outcome, units)


def spread_line(spread: Spread, units: Units) -> str:
    """Return how much the seeds differ, in one line."""
    return (
        f"{spread['seeds']} seeds: mean error {format_length(spread['mean'], units, 4)} ± "
        f"{format_length(spread['deviation'], units, 4)} {units} from seed to seed; worst single error "
        f"{format_length(spread['worst'], units, 4)} {units} (seed {spread['worst_seed']}); {spread['missed']} drums "
        f"not found, at most {spread['missed_most']} by one seed; {spread['false']} false"
    )


def scene_line(outcome: SceneOutcome, units: Units) -> str:
    """Return a scene's outcome in one line."""
    drums, boxes = outcome["drums"], outcome["boxes"]
    parts = [_found(what, rows) for what, rows in (("drums", drums), ("boxes", boxes)) if rows]
    line = f"{outcome['scene']}: {_summary_line(', '.join(parts) or 'nothing to be found', outcome, units)}"
    if outcome["inside_95"] is not None:
        line += f"; {outcome['inside_95']:.1%} of the drums found stand in their 95 % ellipse"
    if (fix := outcome["first_fix"]) is not None:
        least = "a drum never" if fix["least"] is None else f"{format_length(fix['least'], units)} {units}"
        line += (
            f"; first sure fix before passing: least {least}, median {format_length(fix['median'], units)} {units}, "
            f"{fix['share']:.0%} by {format_length(EARLY_FIX_M, units)} {units}"
        )
    if outcome["scene"] == "halls" and drums:
        recall = sum(row["estimate"] is not None for row in drums) / len(drums)
        line += f"; recall {recall:.3f}, {outcome['false'] / outcome['halls']:.3f} false a hall"
    return line


def _found(what: str, rows: Sequence[DrumRow | BoxRow]) -> str:
    return f"{sum(row['estimate'] is not None for row in rows)} of {len(rows)} {what} found"


def _summary_line(found: str, outcome: Outcome, units: Units) -> str:
    """Return the line below a table of objects: found, false, errors, and the cost of a cycle."""
    mean, worst = outcome["mean_error"], outcome["max_error"]
    errors = (
        ""
        if mean is None or worst is None
        else (f", mean error {format_length(mean, units, 3)} {units}, max {format_length(worst, units, 3)} {units}")
    )
    return (
        f"{found}, {outcome['false']} false{errors}; {outcome['times_real_time']:.0f} times real time; "
        f"a cycle takes {outcome['cycle_us']['p50'] / 1e3:.2f} ms, p99 {outcome['cycle_us']['p99'] / 1e3:.2f} ms"
    )


def objects_table(objects: list[ObjectRow], units: Units, frame: str = "odometry") -> Table:
    """Return what was seen, in the frame of this name."""
    table = Table(title=f"objects, in the {frame}'s frame", title_justify="left")
    for heading in ("no.", "model", f"x ({units})", f"y ({units})", "heading", "support", "score"):
        table.add_column(heading, justify="right")
    for seen in objects:
        table.add_row(
            str(seen.get("number", "–")),
            seen["model"],
            page_text.number(seen["x"], units),
            page_text.number(seen["y"], units),
            page_text.degrees(seen["theta"]),
            str(seen["support"]),
            f"{seen['score']:.2f}",
        )
    return table


def walls_table(walls: Sequence[WallRow], units: Units, frame: str = "odometry") -> Table:
    """Return the walls with their ends, in the frame of this name."""
    table = Table(title=f"walls, in the {frame}'s frame", title_justify="left")
    for heading in ("no.", f"from ({units})", f"to ({units})", f"length ({units})", "probability"):
        table.add_column(heading, justify="right")
    for wall in walls:
        x1, y1, x2, y2 = wall["x1"], wall["y1"], wall["x2"], wall["y2"]
        table.add_row(
            str(wall["number"] or "–"),
            f"{page_text.number(x1, units)}, {page_text.number(y1, units)}",
            f"{page_text.number(x2, units)}, {page_text.number(y2, units)}",
            page_text.number(math.dist((x1, y1), (x2, y2)), units),
            page_text.percent(wall["probability"]),
        )
    return table


def polylines_line(polylines: Sequence[PolylineRow], units: Units) -> str:
    """Return how many polylines there are, and their length together, in one line."""
    length_m = sum(math.dist(a, b) for one in polylines for a, b in pairwise(one["points"]))
    count = "1 polyline" if len(polylines) == 1 else f"{len(polylines)} polylines"
    return f"{count} of what is not straight, {format_length(length_m, units, 1)} {units} long together"


def pose_line(pose: PoseRow, units: Units) -> str:
    """Return where the robot is in the map frame, in one line."""
    sigma_x, sigma_y, sigma_theta = (math.sqrt(pose["covariance"][i][i]) for i in range(3))
    heading = math.degrees(pose["theta"]) % 360.0
    return (
        f"{pose['status']}: the robot is at {format_point(pose['x'], pose['y'], units)} {units}, "
        f"{page_text.spread(max(sigma_x, sigma_y), units)}, heading {heading:.1f}° "
        f"{page_text.turn_spread(sigma_theta)}"
    )


def budget_table(rows: Sequence[BudgetRow], unit: str, units: Units) -> Table:
    """Return when the answers came under each budget, and what they were in the end.

    Parameters
    ----------
    rows : sequence of BudgetRow
        The results, one budget each; lengths in metres.
    unit : str
        Unit of the budgets for the heading, e.g. ms.
    units : {"m", "ft"}
        Units of the printed lengths.
    """
    title = "a hall of 40 drums: when the answers come, and what they are in the end"
    caption = "first: until a drum was reported; way: the robot's until each was; mean, max: error"
    table = Table(title=title, title_justify="left", caption=caption, caption_justify="left")
    for heading, of in zip(
        ("budget", "quanta", "cut", "first", "way", "found", "false", "mean", "max"),
        (unit, "a cycle", "short", "s", units, "", "", units, units),
        strict=True,
    ):
        table.add_column(f"{heading}\n{of}", justify="right", no_wrap=True)
    for row in rows:
        first_s, lengths = row["first_s"], ((row["way_m"], 2), (row["mean_error"], 4), (row["max_error"], 4))
        way, mean, worst = ("" if v is None else format_length(v, units, digits) for v, digits in lengths)
        first = "" if first_s is None else f"{first_s:.2f}"
        found = f"{row['found']}/{row['drums']}"
        cut = f"{row['cut_short']:.1%}"
        table.add_row(
            f"{row['budget']:g}", f"{row['quanta']:.2f}", cut, first, way, found, str(row["false"]), mean, worst
        )
    return table


def drift_table(rows: Sequence[DriftRow], units: Units) -> Table:
    """Return what rounds with drifting odometry gave, with and without correction.

    Parameters
    ----------
    rows : sequence of DriftRow
        The results, one level of errors each; lengths in metres.
    units : {"m", "ft"}
        Units of the printed lengths.
    """
    title = "three rounds among eight drums: errors at the end, with and without correction of the drift"
    caption = "error: of the drums, as seen from the robot; place, heading: of the robot; NEES: expected 3 and 2"
    table = Table(title=title, title_justify="left", caption=caption, caption_justify="left")
    names = (
        "scale",
        "walk",
        "corrected",
        "found",
        "false",
        "error",
        "place",
        "heading",
        "NEES",
        "NEES",
        "odometer",
        "range",
    )
    of_units = ("", "°/√m", "", "", "", units, units, "°", "pose", "drums", "", "")
    for heading, of in zip(names, of_units, strict=True):
        table.add_column(f"{heading}\n{of}", justify="right", no_wrap=True)
    for row in rows:
        nees, shares = (row["nees"], row["object_nees"]), (row["odometer_error"], row["range_error"])
        table.add_row(
            f"{row['scale']:.2f}",
            f"{row['heading_deg_per_sqrt_m']:.1f}",
            "yes" if row["corrected"] else "no",
            f"{row['drums'] - row['missed']}/{row['drums']}",
            str(row["false"]),
            "" if row["mean_error"] is None else format_length(row["mean_error"], units, 3),
            format_length(row["place"], units, 3),
            f"{row['heading_deg']:.2f}",
            *("" if one is None else f"{one:.2f}" for one in nees),
            *("" if one is None else f"{one:.2%}" for one in shares),
        )
    return table


def timing_table(summary: RunSummary) -> Table:
    """Return where a run's time went, ms: each phase and callback, lateness, and how long echoes waited."""
    timing = summary["timing"]
    table = Table(title="where the time went (ms)", title_justify="left")
    for heading in ("what", "median", "p99", "p99.9", "worst"):
        table.add_column(heading, justify="left" if heading == "what" else "right")
    rows = {
        **timing["phases"],
        **{f"between cycles: {name}": spread for name, spread in timing["callbacks"].items()},
        "lateness of a cycle's start": timing["late"],
        "wait of an echo for its cycle": timing["echo_wait"],
    }
    for name, spread in rows.items():
        figures = (spread["p50"], spread["p99"], spread["p999"], spread["max"])
        table.add_row(name, *(f"{figure / 1e3:.2f}" for figure in figures))
    return table


def timing_line(summary: RunSummary) -> str:
    """Return how well a run kept its time, and what kept it from that, in one line."""
    timing = summary["timing"]
    line = (
        f"{summary['cycles']} cycles, {timing['following']:.0%} of them with the ring; {summary['late']} late, "
        f"{timing['missed']} missed, {timing['overruns']} overruns"
    )
    by = ", ".join(f"{cause} ({count})" for cause, count in timing["faults"].items())
    return f"{line}; caused by: {by}" if by else line
