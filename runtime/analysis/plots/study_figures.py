"""The figures of a study: how one result is paid for with another, what each setting changes, a search's course."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from runtime.analysis.plots.plot_style import ECHO, MUTED, SEGMENT, WIDTH_IN

Points = Sequence[tuple[float, float]]


def trade_off_figure(points: Points, front: Points, best: tuple[float, float], labels: tuple[str, str]) -> Figure:
    """Return the figure of two results of every combination of settings.

    `front` are the points (x, y) that no other is better than in everything, `best` is that of the order of the
    objectives, and labels are those of both axes.
    """
    figure = Figure(figsize=(WIDTH_IN, 3.6), layout="constrained")
    axes = figure.subplots()
    axes.plot(
        *zip(*points, strict=True),
        linestyle="",
        marker="o",
        markersize=4,
        color=MUTED,
        alpha=0.6,
        label="combinations",
        gid="combinations",
    )
    axes.plot(
        *zip(*sorted(front), strict=True),
        marker="o",
        markersize=5,
        linewidth=1.2,
        color=ECHO,
        label="no other better in all",
        gid="front",
    )
    axes.plot(*best, linestyle="", marker="*", markersize=11, color=SEGMENT, label="best", gid="best")
    axes.set(xlabel=labels[0], ylabel=labels[1])
    axes.legend()
    return figure


def effects_figure(effects: Sequence[tuple[str, Sequence[tuple[str, float]]]], objective: str) -> Figure:
    """Return the figure of an objective's mean for each value of each setting.

    Each effect is a setting, and its values as text with the mean of the objective.
    """
    figure = Figure(
        figsize=(WIDTH_IN, 0.9 + 0.28 * sum(len(values) + 1 for _, values in effects)), layout="constrained"
    )
    axes = figure.subplots()
    at, ticks = 0, []
    for setting, values in effects:
        rows = range(at, at + len(values))
        axes.plot([mean for _, mean in values], rows, marker="o", markersize=5, color=ECHO, linewidth=1.2)
        ticks += [(row, f"{setting} = {text}") for row, (text, _) in zip(rows, values, strict=True)]
        at += len(values) + 1
    axes.set_yticks([row for row, _ in ticks], [text for _, text in ticks])
    axes.invert_yaxis()
    axes.set_xlabel(f"mean {objective}")
    return figure


def search_figure(trials: Points, best: Sequence[float]) -> Figure:
    """Return the figure of a search: the cost of each trial.

    Each trial is its number and cost, the first that of the present settings; `best` is the least cost up to each.
    """
    figure = Figure(figsize=(WIDTH_IN, 2.8), layout="constrained")
    axes = figure.subplots()
    numbers = [trial for trial, _ in trials]
    axes.plot(
        *zip(*trials, strict=True),
        linestyle="",
        marker="o",
        markersize=4,
        color=MUTED,
        alpha=0.6,
        label="trials",
        gid="trials",
    )
    axes.step(numbers, best, where="post", linewidth=1.4, color=ECHO, label="best so far", gid="best")
    axes.plot(*trials[0], linestyle="", marker="s", markersize=7, color=SEGMENT, label="present", gid="present")
    axes.set(xlabel="trial", ylabel="cost")
    axes.legend()
    return figure
