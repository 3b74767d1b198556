"""`echolocate experiment drift`: rounds among drums with drifting odometry, with and without correction."""

from __future__ import annotations

from typing import TYPE_CHECKING

from config.errors import DONE
from config.load import load_settings
from runtime.cli.commands.output_files import check_outputs
from runtime.cli.terminal.escaping_console import EscapingConsole
from runtime.support.kernel_cache import LOCALIZATION, needed_parts
from runtime.support.kernel_warmup import prepare_kernels
from runtime.support.progress import progress

if TYPE_CHECKING:
    from runtime.cli.commands.experiments.experiment import Experiment


def run_drift(common: Experiment) -> int:
    """Drive the rounds at each level of errors, print a table and return the exit code."""
    models, seeds, json_file = common.models, common.seeds, common.json_file
    settings = load_settings("hallway", common.sets, models=models)
    console = EscapingConsole(stderr=True)
    check_outputs({"--json": json_file}, force=common.force)
    prepare_kernels(settings, console, (*needed_parts(settings), LOCALIZATION))
    from runtime.cli.tables import drift_table
    from runtime.cycle.summary import write_json
    from runtime.simulation.drift_trials import LEVELS, drive, summarise_drives

    rows = []
    with progress(console, "driving", 2 * len(LEVELS) * seeds) as step:
        for errors in LEVELS:
            for corrected in (False, True):
                outcomes = []
                for seed in range(seeds):
                    outcomes.append(drive(settings, errors, seed, corrected=corrected))
                    step()
                rows.append(summarise_drives(errors, outcomes))
    if json_file is not None:
        write_json(json_file, {"levels": rows})
    EscapingConsole().print(drift_table(rows, common.units))
    return DONE
