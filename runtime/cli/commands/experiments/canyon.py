"""`echolocate experiment canyon`: drives to a goal behind a box canyon, by several sets of schemas."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Final, Literal

from rich.box import SIMPLE
from rich.table import Table

from config.errors import DONE
from config.load import load_settings
from runtime.cli.commands.output_files import check_outputs
from runtime.cli.terminal.escaping_console import EscapingConsole
from runtime.support.kernel_warmup import prepare_kernels
from runtime.support.progress import progress

if TYPE_CHECKING:
    from runtime.cli.commands.experiments.experiment import Experiment

REFLECTIONS: Final[tuple[Literal["specular", "cone"], ...]] = ("specular", "cone")
_REACTIVE: Final = ("behaviors.follow_valley.follow_valley_gain=0", "behaviors.leave_canyon.leave_canyon_gain=0")
SCHEMAS: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType(
    {
        "leave-canyon": (),
        "follow-valley": ("behaviors.leave_canyon.leave_canyon_gain=0",),
        "move-to-goal": _REACTIVE,
        "… and avoid-past": (*_REACTIVE, "behaviors.avoid_past.avoid_past_gain=1"),
        "… and noise": (*_REACTIVE, "behaviors.noise.noise_gain=0.5"),
        "… and swirl": (*_REACTIVE, "behaviors.swirl.swirl_gain=1"),
    }
)
"""The sets of schemas, each beside avoid-static-obstacle, and the settings that make them."""


def run_canyons(common: Experiment) -> int:
    """Drive in so many worlds with each set of schemas, print a table and return the exit code."""
    models, seeds, json_file = common.models, common.seeds, common.json_file
    chosen = {name: load_settings("hallway", (*own, *common.sets), models=models) for name, own in SCHEMAS.items()}
    console = EscapingConsole(stderr=True)
    check_outputs({"--json": json_file}, force=common.force)
    prepare_kernels(chosen["leave-canyon"], console)
    from runtime.cycle.summary import write_json
    from runtime.simulation.canyon_trials import CanyonRow, drive, summarise
    from runtime.simulation.canyon_worlds import canyon_world

    rows: list[CanyonRow] = []
    with progress(console, "driving", len(REFLECTIONS) * len(SCHEMAS) * seeds) as step:
        for reflection in REFLECTIONS:
            for name, settings in chosen.items():
                outcomes = []
                for seed in range(seeds):
                    outcomes.append(drive(settings, canyon_world(seed, reflection), seed))
                    step()
                rows.append(summarise(name, reflection, outcomes))
    if json_file is not None:
        write_json(json_file, {"rows": rows})
    table = Table(box=SIMPLE, padding=(0, 1, 0, 0))  # 80 columns wide
    for heading in ("schemas", "walls", "escaped", "turned", "if heard", "twice", "contacts", "way"):
        table.add_column(heading, no_wrap=heading == "schemas")
    for row in rows:
        way = "–" if row["way"] is None else f"{row['way']:.2f}"
        table.add_row(
            row["schemas"],
            row["reflection"],
            f"{row['escaped']}/{row['worlds']}",
            f"{row['turned']}/{row['deep']}",
            f"{row['turned_heard']}/{row['heard']}",
            str(row["entered_again"]),
            str(row["contacts"]),
            way,
        )
    EscapingConsole().print(table)
    return DONE
