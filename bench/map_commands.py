"""Measurements of maps: what stands around the ring, what is reported where nothing does, how large a map may be."""

from __future__ import annotations

from pathlib import Path
from typing import Final, Literal, TypeAlias, get_args

from rich.console import Console

from bench.in_rooms import BY_BAYES, try_in_rooms
from bench.table import report, rows_table, wide
from bench.trials.imperfect_rooms import MODELS
from config.load import load_settings
from config.units import FOOT_M
from runtime.support.kernel_cache import EMULATOR, GRIDS, use_kernel_cache
from runtime.support.kernel_warmup import prepare_kernels

STEPS_FT: Final = (0.05, 0.2, 0.5, 1.0)
"""Distances between two firings of one sensor in the rooms with walls, ft."""

Furniture: TypeAlias = Literal["boxes", "clutter"]


def grid(
    *, json: str = "grid.json", laser: tuple[Path, ...] = (), corridor: Path | None = None, seed: int = 0
) -> int:
    """Measure evidence grids: ours and those of others in rooms and in a corridor, and the time that ours take.

    Parameters
    ----------
    json
        File to write.
    laser
        Recordings of a laser with corrected poses, as CARMEN logs.
    corridor
        Folder with poses.txt and measurement.txt of the corridor that eight sonars recorded (tests/data/README.md).
    seed
        Of the readings that are too long in the rooms of mirrors.
    """
    use_kernel_cache()
    from bench.grid import measure_corridor, measure_cost, measure_rooms

    console, settings = Console(stderr=True), load_settings("hallway")
    prepare_kernels(settings, console, GRIDS)
    with console.status("bench") as status:
        rows = {"time": measure_cost(settings.ring)}
        if laser:
            rows["rooms"] = measure_rooms(laser, seed, status.update)
        if corridor is not None:
            rows["corridor"] = measure_corridor(corridor, status.update)
    tables = [rows_table(f"evidence grids: {title}", part) for title, part in rows.items()]
    for table in tables[1:]:
        wide().print(table)
    return report(json, rows, tables[0])


def free_cells(*, json: str = "free-cells.json", rooms: int = 20, seed: int = 0) -> int:
    """Count the cells that the evidence grid and the exported image call free and that no sound could have reached.

    Parameters
    ----------
    json
        File to write.
    rooms
        How many random rooms.
    seed
        The first of them.
    """
    use_kernel_cache()
    from bench.free_cells import measure

    console, settings = Console(stderr=True), load_settings("hallway", ["perception.grid.method=directed"])
    prepare_kernels(settings, console, (EMULATOR, *GRIDS))
    with console.status("bench") as status:
        rows = measure(settings, range(seed, seed + rooms), status.update)
    return report(json, rows, rows_table("cells called free", rows))


def standing(*, json: str = "standing.json", rooms: int = 100, minutes: float = 10.0, first: int = 0) -> int:
    """Count what was sure after a minute's drive and is lost, moved or false after standing; and sensors named.

    Parameters
    ----------
    json
        File to write.
    rooms
        How many random rooms, each by both models of reflection.
    minutes
        How long the robot stands, min of virtual time.
    first
        Seed of the first room.
    """
    use_kernel_cache()
    from bench.standing import measure

    seeds = range(first, first + max(1, rooms))
    return try_in_rooms(
        lambda settings, tell: measure(settings, seeds, minutes, tell),
        lambda rows: rows_table(f"what is sure at a stop, and after {minutes:g} min, in {len(seeds)} rooms", rows),
        json, BY_BAYES,
    )  # fmt: skip


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

    return try_in_rooms(lambda settings, tell: measure(settings, drums, seed, tell), map_table, json)


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
    return try_in_rooms(lambda settings, tell: measure(settings, rooms, steps, tell), walls_table, json, BY_BAYES)


def corner_bound(
    *, json: str = "corner_bound.json", seeds: int = 30, first: int = 0, steps: tuple[float, ...] = (1.0, 0.2)
) -> int:
    """Measure which corners and edges between mirrors their echoes place, and distinguish from walls and posts.

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
    from bench.corner_bound import measure

    rooms = range(first, first + max(1, seeds))
    return try_in_rooms(
        lambda settings, tell: measure(settings.ring, rooms, steps, tell),
        lambda rows: rows_table("corners and edges between mirrors, association perfect", rows), json,
        parts=(EMULATOR,),
    )  # fmt: skip


def false_walls(*, json: str = "false_walls.json", halls: int = 100, hours: float = 10.0, first: int = 0) -> int:
    """Measure whether walls are reported where nothing but drums stands.

    Parameters
    ----------
    json
        File to write.
    halls
        Number of random halls of drums, posts and barrels, at steps of .05 to 1 ft in turn; 0: none.
    hours
        Virtual time in the hall of `make run`, by each model of reflection; 0: none.
    first
        Seed of the first hall.
    """
    use_kernel_cache()
    from bench.false_walls import measure

    seeds = range(first, first + max(0, halls))
    return try_in_rooms(
        lambda settings, tell: measure(settings, seeds, max(0.0, hours), tell),
        lambda rows: rows_table("walls reported where nothing but drums stands", rows), json, BY_BAYES,
    )  # fmt: skip


def false_canyons(*, json: str = "false_canyons.json", halls: int = 100, corridors: int = 100, first: int = 0) -> int:
    """Measure whether canyons are reported where no dead end is: among drums, and in corridors with doorways.

    Parameters
    ----------
    json
        File to write.
    halls
        Number of random halls of drums, posts and barrels, at steps of .05 to 1 ft in turn; 0: none.
    corridors
        Number of random corridors with doorways of 1.1 m and more; 0: none.
    first
        Seed of the first hall and corridor.
    """
    use_kernel_cache()
    from bench.false_canyons import measure

    seeds, ways = (range(first, first + max(0, count)) for count in (halls, corridors))
    return try_in_rooms(
        lambda settings, tell: measure(settings, seeds, ways, tell),
        lambda rows: rows_table("canyons reported where no dead end is", rows), json, BY_BAYES,
    )  # fmt: skip


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
    return try_in_rooms(
        lambda settings, tell: measure(settings, seeds, max(0.01, minutes), furniture, tell),
        lambda rows: rows_table(title, rows), json, BY_BAYES,
    )  # fmt: skip


def imperfect_rooms(
    *,
    json: str = "imperfect_rooms.json",
    rooms: int = 10,
    first: int = 0,
    drums: int = 3,
    step: float = 0.2,
    models: tuple[str, ...] = tuple(MODELS),
    hall_seeds: int = 0,
    jitter: bool = False,
) -> int:
    """Measure what is found in furnished, imperfect rooms by rays, cones, mirrors, a mixture of them and pose jitter.

    Parameters
    ----------
    json
        File to write.
    rooms
        Number of rooms.
    first
        Seed of the first room.
    drums
        Drums in each room; 0: what is reported as one is false.
    step
        Distance between two firings of one sensor, ft.
    models
        By which acoustics the rooms are heard.
    hall_seeds
        In place of rooms, drive down the paper's hall of six drums with this many seeds, by rays and cone, with the
        Denning and a Pioneer.
    jitter
        In place of rooms with furniture, drive through those of `bench walls`, by cones and mirrors, with poses that
        jump by 3 cm and .3° from one firing to the next.
    """
    use_kernel_cache()
    from bench.imperfect_rooms import measure, measure_halls, measure_jitter

    if hall_seeds > 0:
        return try_in_rooms(
            lambda _, tell: measure_halls(range(first, first + hall_seeds), tell),
            lambda rows: rows_table("the paper's hall, by rays in the beam", rows), json, BY_BAYES,
        )  # fmt: skip
    seeds = range(first, first + max(1, rooms))
    if jitter:
        return try_in_rooms(
            lambda settings, tell: measure_jitter(settings, seeds, step * FOOT_M, tell),
            lambda rows: rows_table(f"rooms of walls and drums, pose jitter, {step:g} ft", rows), json, BY_BAYES,
        )  # fmt: skip
    return try_in_rooms(
        lambda settings, tell: measure(settings, seeds, models, step * FOOT_M, drums, tell),
        lambda rows: rows_table(f"furnished, imperfect rooms, {step:g} ft", rows), json, BY_BAYES,
    )  # fmt: skip


def range_statistics(
    *,
    json: str = "range_statistics.json",
    rooms: int = 20,
    first: int = 0,
    models: tuple[str, ...] = ("cone", "mirrors", "mixture"),
    real: Path | None = None,
) -> int:
    """Compare the ranges of generated rooms with those of real drives: silence, late echoes, jumps, repeats, spread.

    Parameters
    ----------
    json
        File to write.
    rooms
        Number of rooms.
    first
        Seed of the first room.
    models
        By which acoustics the rooms are heard.
    real
        Folder of the real drives; without it what is known of them.
    """
    use_kernel_cache()
    from bench.range_statistics import measure

    seeds = range(first, first + max(1, rooms))
    return try_in_rooms(
        lambda _, tell: measure(seeds, models, real, tell),
        lambda rows: rows_table("ranges of real drives and of generated rooms", rows), json, parts=(EMULATOR,),
    )  # fmt: skip


def real_rooms(drives: tuple[Path, ...], *, json: str = "real_rooms.json", rounded: int = 0) -> int:
    """Measure what is explained of drives through real rooms, whose echoes were cut from the scans of a laser.

    Parameters
    ----------
    drives
        Folders with ring.csv, robot.toml, truth.csv and bearings.csv, and beside each NAME-points.csv.
    json
        File to write.
    rounded
        Times that each is perceived again with rounded poses, ranges and times; the spread is then a figure.
    """
    use_kernel_cache()
    from bench.real_rooms import measure

    console, settings = Console(stderr=True), load_settings("hallway").of_log()
    prepare_kernels(settings, console)
    with console.status("bench") as status:
        rows = measure(drives, max(0, rounded), status.update)
    return report(json, rows, rows_table("real rooms, exact poses", rows))
