"""Tables for people: the paper's Table 2, objects seen, and how the cycles went."""

from __future__ import annotations

from typing import Final, Literal, TypeAlias

from rich.table import Table

from runtime.experiment import Outcome
from runtime.summary import ObjectRow

Units: TypeAlias = Literal["m", "ft"]

METRES_A_FOOT: Final = 0.3048


def length(metres: float, units: Units, digits: int = 2) -> str:
    """Return a length as text in the units asked for."""
    return f"{metres if units == 'm' else metres / METRES_A_FOOT:.{digits}f}"


def place(x: float, y: float, units: Units) -> str:
    """Return a place as the paper writes it."""
    return f"({length(x, units)}, {length(y, units)})"


def table_2(outcome: Outcome, units: Units) -> Table:
    """Return truth, estimate and error of each drum."""
    table = Table(title="Table 2: drums in world coordinates", title_justify="left")
    for heading in ("drum", f"truth ({units})", f"estimate ({units})", f"error ({units})"):
        table.add_column(heading, justify="right")
    for number, row in enumerate(outcome["drums"], 1):
        estimate, error = row["estimate"], row["error"]
        table.add_row(
            str(number),
            place(*row["truth"], units),
            "not found" if estimate is None else place(*estimate, units),
            "" if error is None else length(error, units, 3),
        )
    return table


def verdict(outcome: Outcome, units: Units) -> str:
    """Return the experiment in one line."""
    found = sum(row["estimate"] is not None for row in outcome["drums"])
    mean, worst = outcome["mean_error"], outcome["max_error"]
    errors = "" if mean is None or worst is None else (
        f", mean error {length(mean, units, 3)} {units}, max {length(worst, units, 3)} {units}"
    )  # fmt: skip
    return (
        f"{found} of {len(outcome['drums'])} drums found, {outcome['false']} false{errors}; "
        f"{outcome['times_real_time']:.0f} times real time; a cycle takes {outcome['cycle_us']['p50'] / 1e3:.2f} ms, "
        f"p99 {outcome['cycle_us']['p99'] / 1e3:.2f} ms"
    )


def objects_table(objects: list[ObjectRow], units: Units) -> Table:
    """Return what was seen, in the odometry's frame."""
    table = Table(title="objects, in the odometry's frame", title_justify="left")
    for heading in ("model", f"x ({units})", f"y ({units})", "heading (°)", "segments", "score"):
        table.add_column(heading, justify="right")
    for seen in objects:
        table.add_row(
            seen["model"],
            length(seen["x"], units),
            length(seen["y"], units),
            f"{seen['theta'] * 57.29578:.0f}",
            str(seen["support"]),
            f"{seen['score']:.2f}",
        )
    return table
