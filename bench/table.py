"""Table of the comparison: one row per candidate, lengths in feet, times in milliseconds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rich.console import Console
from rich.table import Table

from bench.measure import Plan, Result, SceneScore, Times


def results_table(results: Sequence[Result], plan: Plan) -> Table:
    """Return the table of all results."""
    table = Table(
        title="Lengths in feet; f/f: found/false; ms: median per ring reading, for peers without segments and "
        "association,\nwhich they share and which have their own columns; for our methods everything",
        title_justify="left",
    )
    table.add_column("method")
    headings = (
        "clean\nmean/max", "moved\nf/f mean/max", "noisy\nf/f (mean)", "walls\nf/f (mean)", "jit10\nf/f (mean)",
        "boxes false\nfacing, 45°", "ms", "ms of\nassociation", "ms of\nsegments",
        f"ms\npass {plan.passes}", f"pass\n{plan.passes} / 1",
    )  # fmt: skip
    for heading in headings:
        table.add_column(heading, justify="right")
    for result in results:
        scenes = result["scenes"]
        moved = scenes["moved"]
        table.add_row(
            f"{result['name']} ({result['version']})",
            ("" if scenes["clean"]["found"] == scenes["clean"]["of"] else _counts(scenes["clean"]) + " ")
            + _mean_max(scenes["clean"]),
            f"{_counts(moved)} {_mean_max(moved)}",
            _counts_and_mean(scenes["noisy"]),
            _counts_and_mean(scenes["walls"]),
            _counts_and_mean(scenes["jit10"]),
            f"{scenes['boxes_facing']['false']}, {scenes['boxes_45']['false']}",
            f"{result['ms']['own']:.3f}",
            _part(result["ms"]["association"]),
            _part(result["ms"]["front_end"]),
            "–" if result["ms_last_pass"] is None else f"{result['ms_last_pass']['own']:.3f}",
            _growth(result["ms_first_pass"], result["ms_last_pass"]),
        )
    return table


def _counts(score: SceneScore) -> str:
    return f"{score['found']}/{score['false']}"


def _mean_max(score: SceneScore) -> str:
    return f"{_length(score['mean_ft'])}/{_length(score['max_ft'])}"


def _counts_and_mean(score: SceneScore) -> str:
    return f"{_counts(score)} ({_length(score['mean_ft'])})"


def _length(feet: float | None) -> str:
    return "–" if feet is None else f"{feet:.4f}".removeprefix("0")


def _part(ms: float) -> str:
    return f"{ms:.3f}" if ms else "in ms"


def _growth(first: Times | None, last: Times | None) -> str:
    return "–" if first is None or last is None else f"{last['own'] / first['own']:.2f}"


def rows_table(title: str, rows: Mapping[str, Mapping[str, float]]) -> Table:
    """Return a table with a row for each method; a figure that a method does not have is left empty.

    Parameters
    ----------
    title : str
        Of the table.
    rows : mapping
        The figures of each method.
    """
    table = Table(title=title, title_justify="left")
    columns = dict.fromkeys(column for row in rows.values() for column in row)
    for column in ("method", *columns):
        table.add_column(column, justify="left" if column == "method" else "right")
    for method, row in rows.items():
        table.add_row(method, *(f"{row[column]:.3g}" if column in row else "" for column in columns))
    return table


def report(json: str, rows: object, table: Table) -> int:
    """Write what was measured and print its table; return the exit code."""
    from runtime.cycle.summary import write_json

    write_json(json, rows)
    wide().print(table)
    return 0


def wide() -> Console:
    """Return a console for tables: the terminal, or 180 columns where output is redirected."""
    out = Console()
    return out if out.is_terminal else Console(width=180)
