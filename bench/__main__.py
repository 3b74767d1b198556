"""Command line of the measurements (`make bench`): comparison, timing, recording, console, wake-ups, places, maps."""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Final, Literal, TypeAlias, TypeVar, get_args

from cyclopts import App, Parameter
from rich.console import Console
from rich.table import Table

from bench.console import console_table
from bench.console import figures as figures_of
from bench.console import measure as measure_console
from bench.estimator import Peer
from bench.measure import Plan, measure
from bench.recording import measure_recording
from bench.runners import Method, candidates
from bench.table import results_table, rows_table
from bench.timing import Timing, TimingPlan, measure_timing
from bench.timing_table import figures_table, quantiles_table, read_earlier
from bench.waking import figures, waking_table
from bench.waking import measure as measure_waking
from config.errors import UserError
from config.load import load_settings
from config.settings import Settings
from runtime.support.kernel_cache import EMULATOR, PARTS, prepare_kernels, use_kernel_cache

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
STEPS_FT: Final = (0.05, 0.2, 0.5, 1.0)
"""Distances between two firings of one sensor in the rooms with walls, ft."""

Furniture: TypeAlias = Literal["boxes", "clutter"]

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
    return _report(
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
    return _report(json, {"seconds": seconds, "rounds": rounds, "rows": rows}, console_table(rows, seconds, rounds))


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
    return _report(json, by_load, waking_table(by_load))


Rows = TypeVar("Rows")

BY_BAYES: Final = ("perception.method=bayes",)
"""The setting of benches that are about the Bayesian method."""


def _try_in_rooms(
    measure: Callable[[Settings, Callable[[str], None]], Rows],
    table: Callable[[Rows], Table],
    json: str,
    sets: tuple[str, ...] = (),
    parts: tuple[str, ...] | None = None,
) -> int:
    """Write and print what is measured in rooms or halls, with these settings and parts of the kernels."""
    console = Console(stderr=True)
    settings = load_settings("hallway", sets)
    prepare_kernels(settings, console, parts)
    with console.status("bench") as status:
        rows = measure(settings, status.update)
    return _report(json, rows, table(rows))


@app.command
def localization(*, json: str = "localization.json", rooms: int = 100, first: int = 0) -> int:
    """Measure global localisation from one stand of the ring in random known rooms.

    Parameters
    ----------
    json
        File to write.
    rooms
        Number of rooms.
    first
        Seed of the first room.
    """
    use_kernel_cache()
    from bench.localization import localization_table, measure

    seeds = range(first, first + max(1, rooms))
    return _try_in_rooms(
        lambda settings, tell: measure(settings.ring, seeds, tell), localization_table, json, parts=(EMULATOR,)
    )


@app.command
def known_room(
    *,
    json: str = "known_room.json",
    rooms: int = 20,
    first: int = 1000,
    laser: tuple[Path, ...] = (),
    seeds: int = 3,
) -> int:
    """Measure tracking, global localisation and recovery from kidnapping in furnished rooms that are known.

    Parameters
    ----------
    json
        File to write.
    rooms
        Number of rooms; with --laser, of drives from an unknown start in each building.
    first
        Seed of the first room.
    laser
        Measure in real buildings instead: recordings of a laser with corrected poses, as CARMEN logs.
    seeds
        With --laser, number of drives that are tracked along the whole recording.
    """
    use_kernel_cache()
    from bench.known_room import known_room_table, measure, measure_lasers

    def rows(settings: Settings, tell: Callable[[str], None]) -> dict[str, dict[str, float]]:
        if laser:
            return measure_lasers(laser, max(1, rooms), range(max(1, seeds)), tell)
        return measure(settings.ring, range(first, first + max(1, rooms)), tell)

    return _try_in_rooms(rows, known_room_table, json, parts=(EMULATOR,))


@app.command
def beacons(recording: Path, *, json: str = "beacons.json") -> int:
    """Measure the landmark filter on recorded ranges to beacons at unknown places.

    Parameters
    ----------
    recording
        `Plaza1_.mat`, from the examples of gtsam.
    json
        File to write.
    """
    use_kernel_cache()
    from bench.beacons import figures, read_plaza, track

    if not recording.is_file():
        raise UserError(f"{recording}: there is no such file; Plaza1_.mat comes with the examples of gtsam")
    data = read_plaza(recording)
    row = figures(data, track(data))
    return _report(json, row, rows_table("landmark filter on ranges to beacons at unknown places", {"ours": row}))


@app.command
def nees(*, json: str = "nees.json", drives: int = 100, first: int = 200) -> int:
    """Measure whether the correction of drift is as wrong as it says: three rounds among eight drums.

    Parameters
    ----------
    json
        File to write.
    drives
        Number of drives at each level of odometry's errors.
    first
        Seed of the first drive.
    """
    use_kernel_cache()
    from bench.consistency import measure

    seeds = range(first, first + max(1, drives))
    return _try_in_rooms(
        lambda settings, tell: measure(settings, seeds, tell),
        lambda rows: rows_table("squared errors over the reported covariance, 95 % bands of the mean", rows), json,
    )  # fmt: skip


@app.command
def slips(*, json: str = "slips.json", drives: int = 4, first: int = 300) -> int:
    """Measure what remains of slips that the wheels do not report: three rounds among eight drums.

    Parameters
    ----------
    json
        File to write.
    drives
        Number of halls.
    first
        Seed of the first hall.
    """
    use_kernel_cache()
    from bench.slips import measure

    seeds = range(first, first + max(1, drives))
    return _try_in_rooms(
        lambda settings, tell: measure(settings, seeds, tell),
        lambda rows: rows_table("slips of the robot half-way, worst at the end", rows), json,
    )  # fmt: skip


@app.command
def sightings(folder: Path, *, robot: int = 1, json: str = "sightings.json") -> int:
    """Measure the landmark filter, beside gtsam's iSAM2, on recorded sightings of posts at unknown places.

    Parameters
    ----------
    folder
        MRCLAM's data set 1, unpacked.
    robot
        Whose drive.
    json
        File to write.
    """
    use_kernel_cache()
    from bench.sightings import figures, read_mrclam, track

    if not (folder / f"Robot{robot}_Odometry.dat").is_file():
        raise UserError(
            f"{folder}: there is no Robot{robot}_Odometry.dat; it is in the first data set of UTIAS MRCLAM"
        )
    data = read_mrclam(folder, robot)
    found = track(data)
    rows = {"ours": figures(data, found)}
    if find_spec("gtsam"):
        from bench.peers import gtsam_sightings

        rows["gtsam iSAM2"] = gtsam_sightings.figures(data, found.odometer_scale, found.turn_scale)
    return _report(json, rows, rows_table("sightings of posts at unknown places", rows))


@app.command(name="map")
def map_size(*, json: str = "map.json", drums: tuple[int, ...] = (40, 200), seed: int = 0) -> int:
    """Measure what a firing costs in halls of more and more drums, driven through once and back.

    Parameters
    ----------
    json
        File to write.
    drums
        Number of drums of each hall.
    seed
        Of their places and of the noise.
    """
    use_kernel_cache()
    from bench.map_size import map_table, measure

    return _try_in_rooms(lambda settings, tell: measure(settings, drums, seed, tell), map_table, json)


@app.command
def walls(*, json: str = "walls.json", seeds: int = 100, first: int = 0, steps: tuple[float, ...] = STEPS_FT) -> int:
    """Measure the walls found in random rooms with doorways and drums, at several distances between firings.

    Parameters
    ----------
    json
        File to write.
    seeds
        Number of rooms.
    first
        Seed of the first room.
    steps
        Distances between two firings of one sensor, ft.
    """
    use_kernel_cache()
    from bench.walls import measure, walls_table

    rooms = range(first, first + max(1, seeds))
    return _try_in_rooms(lambda settings, tell: measure(settings, rooms, steps, tell), walls_table, json, BY_BAYES)


@app.command
def false_drums(
    *,
    json: str = "false_drums.json",
    rooms: int = 10,
    minutes: float = 30.0,
    first: int = 100,
    furniture: tuple[Furniture, ...] = get_args(Furniture),
) -> int:  # fmt: skip
    """Measure how often a drum is reported in rooms without one: walls and two boxes, and these among clutter.

    Parameters
    ----------
    json
        File to write.
    rooms
        Number of rooms.
    minutes
        Duration of the drive through each, by each model of reflection, in virtual time.
    first
        Seed of the first room.
    furniture
        Two boxes, or these among clutter.
    """
    use_kernel_cache()
    from bench.false_drums import measure

    seeds = range(first, first + max(1, rooms))
    title = f"false drums in rooms without a drum, {minutes:g} min each"
    return _try_in_rooms(
        lambda settings, tell: measure(settings, seeds, max(0.01, minutes), furniture, tell),
        lambda rows: rows_table(title, rows), json, BY_BAYES,
    )  # fmt: skip


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
    wide = _wide()
    wide.print(quantiles_table(result, earlier))
    wide.print(figures_table(result, earlier))
    return 0


def _report(json: str, rows: object, table: Table) -> int:
    """Write what was measured and print its table; return the exit code."""
    from runtime.cycle.summary import write_json

    write_json(json, rows)
    _wide().print(table)
    return 0


def _wide() -> Console:
    """Return a console for tables: the terminal, or 180 columns where output is redirected."""
    out = Console()
    return out if out.is_terminal else Console(width=180)


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
