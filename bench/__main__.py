"""Command line of the measurements (`make bench`): comparison, timing, recording, console, wake-ups, places, maps."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Final, TypeAlias

from cyclopts import App, Parameter
from rich.console import Console

from bench.batch_commands import replay, scheduler, sweep, tune
from bench.console import console_table
from bench.console import figures as figures_of
from bench.console import measure as measure_console
from bench.ear_commands import cross_paths, ear_cost, ear_halls, naming_bound, one_stand, servo, stand_bound
from bench.estimator import Peer
from bench.figures import PAGE, renew
from bench.lie_commands import few_sensors, lies
from bench.map_commands import (
    corner_bound,
    false_canyons,
    false_drums,
    false_walls,
    free_cells,
    grid,
    imperfect_rooms,
    map_size,
    range_statistics,
    real_rooms,
    standing,
    walls,
)
from bench.measure import Plan, measure
from bench.page_growth import measure_page_growth
from bench.place_commands import (
    beacons,
    building_places,
    chatter,
    correction,
    drift_bound,
    known_room,
    localization,
    navigation,
    nees,
    place_bound,
    real_places,
    sightings,
    slips,
    way_places,
)  # fmt: skip
from bench.recording import measure_recording
from bench.runners import Method, candidates
from bench.sensitivity import app as sensitivity
from bench.table import report, results_table, wide
from bench.timing import Timing, TimingPlan, measure_timing
from bench.timing_table import figures_table, quantiles_table, read_earlier
from bench.waking import figures, waking_table
from bench.waking import measure as measure_waking
from config.errors import UserError
from config.load import load_settings
from runtime.support.kernel_cache import PARTS, use_kernel_cache
from runtime.support.kernel_warmup import prepare_kernels

OURS: Final = (
    Method("echolocate, bayes", ("perception.method=bayes",)),
    Method("echolocate, paper", ("perception.method=paper",)),
)
"""Our own methods: name in the table, and settings."""

FULL: Final = Plan(repetitions=3, halls_max=10, passes=20)
QUICK: Final = Plan(repetitions=1, halls_max=2, passes=4)

TIMING: Final = TimingPlan(seconds=20.0, rounds=3, busy=0)
RECORDING: Final = TimingPlan(seconds=60.0, rounds=1, busy=0)
WAKING_TURNS: Final = 10

Measure: TypeAlias = Callable[[TimingPlan, tuple[str, ...], Callable[[str], None]], Timing]

app = App(help="Measure our methods and the libraries one would use instead, on the same readings.")


@app.default
def bench(
    *,
    json: str = "bench.json",
    quick: Annotated[bool, Parameter(negative="")] = False,
    repetitions: int | None = None,
    only: str = "",
) -> int:
    """Compare our methods with the libraries; print the table and write it as JSON.

    Parameters
    ----------
    json
        File to write.
    quick
        Run once, with few halls and few passes.
    repetitions
        Number of repetitions; medians are reported.
    only
        Run only the methods whose name contains this text.
    """
    use_kernel_cache()

    console = Console(stderr=True)
    plan = QUICK if quick else FULL
    if repetitions is not None:
        plan = Plan(max(1, repetitions), plan.halls_max, plan.passes)
    settings = load_settings("hallway")
    prepare_kernels(settings, console, PARTS)
    selected = [c for c in candidates(OURS, load_peers()) if only in c.name]
    if not selected:
        console.print(f"bench: no method's name contains {only!r}", markup=False)
        return 2
    with console.status("bench") as status:
        results = measure(selected, settings.ring, plan, status.update)
    return report(
        json,
        {"repetitions": plan.repetitions, "passes": plan.passes, "results": results},
        results_table(results, plan),
    )


@app.command
def timing(
    *,
    json: str = "timing.json",
    against: str | None = None,
    seconds: float = TIMING.seconds,
    rounds: int = TIMING.rounds,
    busy: int = TIMING.busy,
    sets: Annotated[tuple[str, ...], Parameter(name="--set", negative="", allow_leading_hyphen=False)] = (),
) -> int:
    """Measure the timing of a run over the pty, in turns with minimal control programs.

    Parameters
    ----------
    json
        File to write.
    against
        JSON of an earlier run to compare with.
    seconds
        Duration of our run and of the control in each round, s.
    rounds
        Number of rounds.
    busy
        Number of CPU-bound background processes.
    sets
        Setting to override, as in cycle.rate_hz=10.
    """
    plan = TimingPlan(max(1.0, seconds), max(1, rounds), max(0, busy))
    return _measured(measure_timing, plan, sets, json, against)


@app.command
def recording(
    *,
    json: str = "recording.json",
    against: str | None = None,
    seconds: float = RECORDING.seconds,
    rounds: int = RECORDING.rounds,
    sets: Annotated[tuple[str, ...], Parameter(name="--set", negative="", allow_leading_hyphen=False)] = (),
) -> int:
    """Measure what recording costs a run over the pty: loop time and disk space.

    Parameters
    ----------
    json
        File to write.
    against
        JSON of an earlier run to compare with.
    seconds
        Duration of the runs with and without a recording in each round, s.
    rounds
        Number of rounds.
    sets
        Setting to override, as in recording.keyframe_period_s=10.
    """
    return _measured(measure_recording, TimingPlan(max(1.0, seconds), max(1, rounds), 0), sets, json, against)


@app.command
def console(*, json: str = "console.json", seconds: float = 30.0, rounds: int = 5) -> int:
    """Measure what open pages of the operator console cost a run, in turns with no page open.

    Parameters
    ----------
    json
        File to write.
    seconds
        Duration of each run, s.
    rounds
        Number of rounds.
    """
    use_kernel_cache()

    out = Console(stderr=True)
    seconds, rounds = max(5.0, seconds), max(1, rounds)
    prepare_kernels(load_settings("hallway"), out)
    with out.status("bench") as status:
        rows = figures_of(measure_console(seconds, rounds, status.update))
    return report(json, {"seconds": seconds, "rounds": rounds, "rows": rows}, console_table(rows, seconds, rounds))


@app.command
def pages(*, json: str = "pages.json", hours: float = 2.0) -> int:
    """Measure whether a run grows while pages of the operator console come and go.

    Parameters
    ----------
    json
        File to write.
    hours
        Duration, h.
    """
    use_kernel_cache()

    console = Console(stderr=True)
    prepare_kernels(load_settings("hallway"), console)
    with console.status("bench") as status:
        growth = measure_page_growth(3600.0 * max(0.005, hours), status.update)
    return report(json, growth.as_json(), growth.table())


@app.command
def waking(*, json: str = "waking.json", turns: int = WAKING_TURNS, busy: int = 2) -> int:
    """Measure methods of sleeping until a deadline, on an idle and on a busy machine.

    Parameters
    ----------
    json
        File to write.
    turns
        Number of turns of two seconds for each method.
    busy
        Number of CPU-bound background processes in the second half.
    """

    console = Console(stderr=True)
    with console.status("bench") as status:
        by_load = {
            f"{count} busy": figures(measure_waking(max(1, turns), count, status.update)) for count in (0, busy)
        }
    return report(json, by_load, waking_table(by_load))


@app.command(name="figures")
def figures_page(*, results: Path | None = None) -> int:
    """Write docs/figures.md from bench/figures.toml.

    Parameters
    ----------
    results
        Folder of result files (JSON) whose values are taken in before.
    """
    changed = renew(results)
    Console(stderr=True).print(f"bench: {changed} measured values changed; wrote {PAGE}", markup=False)
    return 0


for command in (
    few_sensors,
    lies,
    localization,
    known_room,
    place_bound,
    navigation,
    beacons,
    chatter,
    correction,
    nees,
    drift_bound,
    slips,
    sightings,
    walls,
    corner_bound,
    false_drums,
    false_walls,
    building_places,
    real_places,
    way_places,
    real_rooms,
    false_canyons,
    free_cells,
    imperfect_rooms,
    range_statistics,
    standing,
    grid,
):
    app.command(command)
app.command(map_size, name="map")
app.command(sensitivity, name="sensitivity")
app.command(cross_paths)
app.command(tune)
app.command(ear_halls)
app.command(sweep)
app.command(scheduler)
app.command(replay)
app.command(one_stand)
app.command(servo)
app.command(stand_bound)
app.command(naming_bound)
app.command(ear_cost)


def _measured(measure: Measure, plan: TimingPlan, sets: tuple[str, ...], json: str, against: str | None) -> int:
    """Run a timing measurement, write its figures as JSON and print its tables; return the exit code."""
    use_kernel_cache()
    from runtime.cli.commands.output_files import check_outputs
    from runtime.cycle.summary import write_json

    console = Console(stderr=True)
    check_outputs({"--json": json}, (against,), force=True)  # the figures of an earlier run of the same name go
    earlier = None if against is None else read_earlier(against)
    prepare_kernels(load_settings("hallway"), console)
    with console.status("bench") as status:
        result = measure(plan, sets, status.update)
    write_json(json, result.as_json())
    out = wide()
    out.print(quantiles_table(result, earlier))
    out.print(figures_table(result, earlier))
    return 0


def load_peers() -> tuple[Peer, ...]:
    """Return the peer of each library; the libraries need the extra `bench`."""
    try:
        from bench.peers import (
            filterpy_ekf,
            gtsam_isam2,
            scipy_ls,
            skimage_hough,
            skimage_ransac,
            small_gicp_icp,
        )
    except ImportError as error:
        sys.exit(f'bench: {error}; install the peers: make bench, or pip install --editable ".[bench]"')
    peers = (gtsam_isam2, filterpy_ekf, scipy_ls, small_gicp_icp, skimage_hough, skimage_ransac)
    return tuple(module.PEER for module in peers)


def main() -> None:
    """Run the command line; report an error that a person has caused in one line."""
    try:
        sys.exit(app(result_action="return_value"))
    except UserError as error:
        Console(stderr=True).print(f"bench: {error}", markup=False)
        sys.exit(error.exit_code)


if __name__ == "__main__":
    main()
