"""Measurements of places and maps: where the ring is, what stands around it, and how large a map may be."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Final, Literal, TypeAlias, TypeVar, get_args

from cyclopts import Parameter
from rich.console import Console
from rich.table import Table

from bench.table import report, rows_table, wide
from config.errors import UserError
from config.load import load_settings
from config.settings import Settings
from runtime.support.kernel_cache import EMULATOR, GRIDS, use_kernel_cache
from runtime.support.kernel_warmup import prepare_kernels

STEPS_FT: Final = (0.05, 0.2, 0.5, 1.0)
"""Distances between two firings of one sensor in the rooms with walls, ft."""

Furniture: TypeAlias = Literal["boxes", "clutter"]

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
    return report(json, rows, table(rows))


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


def known_room(
    *,
    json: str = "known_room.json",
    rooms: int = 20,
    first: int = 1000,
    laser: tuple[Path, ...] = (),
    seeds: int = 3,
    building: float = 0.0,
) -> int:
    """Measure tracking, global localisation and recovery from kidnapping in furnished rooms that are known.

    Parameters
    ----------
    json
        File to write.
    rooms
        Number of rooms; with --laser or --building, of drives from an unknown start in each building.
    first
        Seed of the first room.
    laser
        Measure in real buildings instead: recordings of a laser with corrected poses, as CARMEN logs.
    seeds
        With --laser, number of drives that are tracked along the whole recording.
    building
        Measure in a building of many rooms instead, of this length and width, m.
    """
    use_kernel_cache()
    from bench.known_room import known_room_table, measure, measure_building, measure_lasers

    def rows(settings: Settings, tell: Callable[[str], None]) -> dict[str, dict[str, float]]:
        if laser:
            return measure_lasers(laser, max(1, rooms), range(max(1, seeds)), tell)
        drives = range(first, first + max(1, rooms))
        if building > 0.0:
            return measure_building(settings.ring, building, drives, tell)
        return measure(settings.ring, drives, tell)

    return _try_in_rooms(rows, known_room_table, json, parts=(EMULATOR,))


def place_bound(*, laser: tuple[Path, ...], json: str = "place_bound.json", drives: int = 6, first: int = 100) -> int:
    """Compare ours with an exact filter over all poses: unknown start and kidnapping in real buildings.

    Parameters
    ----------
    laser
        Recordings of a laser with corrected poses, as CARMEN logs.
    json
        File to write.
    drives
        Number of drives in each building.
    first
        Seed of the first drive.
    """
    use_kernel_cache()
    from bench.known_room import known_room_table
    from bench.place_bound import measure

    return _try_in_rooms(
        lambda _, tell: measure(laser, max(1, drives), first, tell), known_room_table, json, parts=(EMULATOR,)
    )


def navigation(
    *,
    json: str = "navigation.json",
    pairs: int = 100,
    first: int = 0,
    laser: tuple[Path, ...] = (),
    only: str = "",
    sets: Annotated[tuple[str, ...], Parameter(name="--set", negative="", allow_leading_hyphen=False)] = (),
) -> int:
    """Measure drives to goals in unknown rooms: ours, the schemas before, VFF, VFH, nav2's recoveries.

    Parameters
    ----------
    json
        File to write.
    pairs
        Number of drives.
    first
        Seed of the first.
    laser
        Drive in real buildings instead of random rooms: recordings of a laser with corrected poses, as CARMEN logs.
    only
        Run only the methods whose name contains this text.
    sets
        Setting to override in all methods, as in behaviors.follow_valley.safety_m=0.25.
    """
    use_kernel_cache()
    from bench.navigation import METHODS, measure, trials_of

    chosen = [name for name in METHODS if only in name]
    if not chosen:
        raise UserError(f"--only {only}: no such method, expected a part of one of: {', '.join(METHODS)}")
    return _try_in_rooms(
        lambda _, tell: measure(trials_of(laser, max(1, pairs), first), chosen, sets, tell),
        lambda rows: rows_table("drives to goals in unknown rooms", rows),
        json,
    )


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
    return report(json, row, rows_table("landmark filter on ranges to beacons at unknown places", {"ours": row}))


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
    return report(json, rows, rows_table("sightings of posts at unknown places", rows))


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
    return _try_in_rooms(
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
    return _try_in_rooms(
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
    return _try_in_rooms(
        lambda settings, tell: measure(settings, seeds, max(0.01, minutes), furniture, tell),
        lambda rows: rows_table(title, rows), json, BY_BAYES,
    )  # fmt: skip
