"""The history of a run: objects known, their errors, and the time between cycles, over time."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from config.units import FOOT_M
from runtime.analysis.plots.layers import match_to_truth
from runtime.analysis.plots.plot_style import ECHO, MODEL, MUTED, SEGMENT, WIDTH_IN
from runtime.analysis.timeline import Timeline
from runtime.support.length_format import Units


def history_figure(timeline: Timeline, units: Units) -> Figure:
    """Return the figure: objects known, their errors if the true world is known, and the time between cycles."""
    with_errors = timeline.world is not None
    figure = Figure(figsize=(WIDTH_IN, 4.6 if with_errors else 3.2), layout="constrained")
    panels = figure.subplots(3 if with_errors else 2, 1, sharex=True)
    times = [m.t_s for m in timeline.snapshots]
    known = panels[0]
    known.step(
        times, [len(m.objects) for m in timeline.snapshots], where="post", color=MODEL, linewidth=1.8, gid="known"
    )
    known.set_ylabel("objects known")
    known.set_ylim(bottom=0.0)
    known.yaxis.set_major_locator(MaxNLocator(integer=True))
    known.set_title("History of the run")
    if with_errors:
        unit = FOOT_M if units == "ft" else 1.0
        errors = [
            [one.error_m / unit for one in match_to_truth(m.objects, timeline).values()] for m in timeline.snapshots
        ]
        at = [t for t, found in zip(times, errors, strict=True) if found]
        panels[1].plot(
            at,
            [max(found) for found in errors if found],
            color=SEGMENT,
            linewidth=1.5,
            linestyle=(0, (3, 1.5)),
            label="worst",
            gid="worst",
        )
        panels[1].plot(
            at,
            [float(np.mean(found)) for found in errors if found],
            color=MODEL,
            linewidth=1.8,
            label="mean",
            gid="mean",
        )
        panels[1].set_ylabel(f"error ({units})")
        panels[1].set_ylim(bottom=0.0)
        if at:
            panels[1].legend(loc="upper right", ncols=2)
    periods = panels[-1]
    gaps = 1e3 * np.array(timeline.cycle_gaps_s)
    times_s = np.cumsum(timeline.cycle_gaps_s)
    periods.plot(
        times_s,
        gaps,
        marker=".",
        markersize=3,
        linestyle="",
        color=ECHO,
        alpha=0.6,
        gid="gaps",
        rasterized=len(gaps) > 2000,
    )
    periods.set(xlabel="t (s)", ylabel="between cycles (ms)")
    periods.set_ylim(0.0, 1.1 * float(gaps.max()) if len(gaps) else None)
    for number, mark in enumerate(timeline.bookmarks, 1):
        for row, panel in enumerate(panels, 1):
            panel.axvline(
                mark.t_s, color=MUTED, linewidth=0.9, linestyle=(0, (1, 1.5)), gid=f"bookmark-{number}-panel-{row}"
            )
        known.annotate(
            str(number),
            (mark.t_s, 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(2.0, -9.0),
            textcoords="offset points",
            fontsize=8,
        )
    figure.align_ylabels()
    return figure
