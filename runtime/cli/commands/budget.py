"""`echolocate experiment budget`: what less time for perception costs, in a hall of forty drums."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import track

from config.errors import DONE, WRONG_CALL, UserError
from config.load import load_settings
from runtime.support.kernel_cache import prepare_kernels

if TYPE_CHECKING:
    from runtime.support.length_format import Units
    from runtime.timing.refinement_budget import RefinementBudget


def run_budgets(
    sets: Sequence[str],
    *,
    budgets_ms: Sequence[float],
    quanta: Sequence[float],
    models: Sequence[str],
    seeds: int,
    json_file: str | None,
    units: Units,
) -> int:
    """Carry out the command; see `runtime.cli.app.experiment`."""
    if seeds < 1:
        raise UserError(f"--seeds {seeds}: must be at least 1", WRONG_CALL)
    if not all(0.0 <= budget < math.inf for budget in (*budgets_ms, *quanta)):
        raise UserError("--budget-ms, --quanta: must be 0 or above", WRONG_CALL)
    settings = load_settings("irregular", sets, models=models)
    console = Console(stderr=True)
    prepare_kernels(settings, console)
    from runtime.cli.tables import budget_table
    from runtime.cycle.summary import write_json
    from runtime.simulation.budget_sweep import drive, long_hall_settings
    from runtime.timing.refinement_budget import CpuTimeBudget, QuantumBudget

    settings = long_hall_settings(settings)
    makers: list[tuple[float, Callable[[], RefinementBudget]]] = (
        [(most, partial(QuantumBudget, most)) for most in quanta]
        or [(most, partial(CpuTimeBudget, 1e-3 * most)) for most in budgets_ms]
    )  # fmt: skip
    # The first drive pays for what is allocated and loaded at first need.
    drive(settings, 0, lambda: QuantumBudget(1), (0,))
    runs = track(makers, "driving", console=console, transient=True, disable=not console.is_terminal)
    rows = [drive(settings, budget, maker, range(seeds)) for budget, maker in runs]
    if json_file is not None:
        write_json(json_file, {"unit": "quanta" if quanta else "ms", "budgets": rows})
    Console().print(budget_table(rows, "quanta" if quanta else "ms", units))
    return DONE
