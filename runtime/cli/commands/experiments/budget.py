"""`echolocate experiment budget`: what smaller time budgets for perception cost, in a hall of forty drums."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING

from config.errors import DONE, WRONG_CALL, UserError
from config.load import load_settings
from runtime.cli.commands.output_files import check_outputs
from runtime.cli.terminal.escaping_console import EscapingConsole
from runtime.support.kernel_warmup import prepare_kernels
from runtime.support.progress import progress

if TYPE_CHECKING:
    from runtime.cli.commands.experiments.experiment import Experiment
    from runtime.timing.refinement_budget import RefinementBudget


def run_budgets(common: Experiment, budgets_ms: Sequence[float], quanta: Sequence[float]) -> int:
    """Drive through the hall under each budget, print a table and return the exit code.

    Raises
    ------
    UserError
        A budget is not a number ≥ 0.
    """
    models, seeds, json_file = common.models, common.seeds, common.json_file
    if not all(0.0 <= budget < math.inf for budget in (*budgets_ms, *quanta)):
        raise UserError("--budget-ms, --quanta: must be 0 or above", WRONG_CALL)
    settings = load_settings("irregular", common.sets, models=models)
    console = EscapingConsole(stderr=True)
    check_outputs({"--json": json_file}, force=common.force)
    prepare_kernels(settings, console)
    from runtime.cli.tables import budget_table
    from runtime.cycle.summary import write_json
    from runtime.simulation.budget_sweep import drive, long_hall_settings
    from runtime.timing.refinement_budget import CpuTimeBudget, QuantumBudget

    settings = long_hall_settings(settings)
    budgets: list[tuple[float, Callable[[], RefinementBudget]]] = [
        (most, partial(QuantumBudget, most)) for most in quanta
    ] or [(most, partial(CpuTimeBudget, 1e-3 * most)) for most in budgets_ms]
    # The first drive pays for what is allocated and loaded on first use.
    drive(settings, 0, lambda: QuantumBudget(1), (0,))
    rows = []
    with progress(console, "driving", len(budgets)) as step:
        for budget, make_budget in budgets:
            rows.append(drive(settings, budget, make_budget, range(seeds)))
            step()
    unit = "quanta" if quanta else "ms"
    if json_file is not None:
        write_json(json_file, {"unit": unit, "budgets": rows})
    EscapingConsole().print(budget_table(rows, unit, common.units))
    return DONE
