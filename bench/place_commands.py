"""Measurements of places: where the ring is, how well it knows that, and how it finds its way."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.console import Console

from bench.in_rooms import try_in_rooms
from bench.table import report, rows_table
from config.errors import UserError
from config.load import load_settings
from config.settings import Settings
from runtime.support.kernel_cache import EMULATOR, LOCALIZATION, needed_parts, use_kernel_cache
from runtime.support.kernel_warmup import prepare_kernels


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
    return try_in_rooms(
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

    return try_in_rooms(rows, known_room_table, json, parts=(EMULATOR,))


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

    return try_in_rooms(
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
    return try_in_rooms(
        lambda _, tell: measure(trials_of(laser, max(1, pairs), first), chosen, sets, tell),
        lambda rows: rows_table("drives to goals in unknown rooms", rows),
        json,
    )


def chatter(*, robots: int = 20, rooms: int = 5, first: int = 100, seconds: float = 40.0, hours: float = 10.0) -> int:
    """Measure how often the commanded speed changes its sign or standstill, and false reports of a base that stands.

    Parameters
    ----------
    robots, rooms
        Number of random robots and of random rooms, each robot in each room by two requests in turn.
    first
        Seed of the first robot.
    seconds
        Length of each drive, s.
    hours
        Time that random bases obey random commands, h.
    """
    use_kernel_cache()
    from tests.runtime.cycle.test_chatter import chatter as figures
    from tests.runtime.cycle.test_motion_monitor import assert_obedient

    console = Console(stderr=True)
    with console.status("bench") as status:
        lines = [figures(range(first, first + max(1, robots)), range(max(1, rooms)), seconds, status.update)]
        status.update("bases that obey")
        lines.append(assert_obedient(range(first, first + round(12.0 * hours)), 300.0))
    Console().print(*lines, sep="\n")
    return 0


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
    return try_in_rooms(
        lambda settings, tell: measure(settings, seeds, tell),
        lambda rows: rows_table("squared errors over the reported covariance, 95 % bands of the mean", rows), json,
    )  # fmt: skip


def correction(*, json: str = "correction.json", drives: int = 40, first: int = 1000) -> int:
    """Compare replays with correction of drift and without, on logs with good and with drifting odometry.

    Parameters
    ----------
    json
        File to write.
    drives
        Number of logs at each level of odometry's errors.
    first
        Seed of the first log.
    """
    use_kernel_cache()
    from bench.correction import measure

    seeds = range(first, first + max(1, drives))
    return try_in_rooms(
        lambda _, tell: measure(seeds, tell),
        lambda rows: rows_table("correction of drift: what it changes, errors without it and with it", rows), json,
    )  # fmt: skip


def drift_bound(*, json: str = "drift-bound.json", drives: int = 100, first: int = 200) -> int:
    """Measure what any filter could know of the drums in the drives of `nees`: one that knows the rest, beside ours.

    Parameters
    ----------
    json
        File to write.
    drives
        Number of drives at each level of odometry's errors, at least two.
    first
        Seed of the first drive.
    """
    use_kernel_cache()
    from bench.drift_bound import measure

    seeds = range(first, first + max(2, drives))
    return try_in_rooms(
        lambda settings, tell: measure(settings, seeds, tell),
        lambda rows: rows_table("mean error of a drum as seen from the robot, ft", rows), json,
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
    return try_in_rooms(
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


def real_places(drives: tuple[Path, ...], *, json: str = "real_places.json") -> int:
    """Measure the place without a map on drives through real rooms, whose odometry drifts, and with exact odometry.

    Parameters
    ----------
    drives
        Folders with ring.csv, robot.toml, truth.csv and bearings.csv.
    json
        File to write.
    """
    use_kernel_cache()
    from bench.real_places import measure

    console, settings = Console(stderr=True), load_settings("hallway").of_log()
    prepare_kernels(settings, console, (*needed_parts(settings), LOCALIZATION))
    with console.status("bench") as status:
        rows = measure(drives, status.update)
    return report(json, rows, rows_table("real drives: errors of the place, m, and shares", rows))


def building_places(logs: tuple[Path, ...], *, json: str = "building_places.json", starts: int = 2) -> int:
    """Measure the place without a map in the worlds of lasers' walls, driven along the laser's way and back.

    Parameters
    ----------
    logs
        CARMEN logs with corrected poses, plain or compressed.
    json
        File to write.
    starts
        Drives in each log and by each model of reflection.
    """
    use_kernel_cache()
    from bench.building_places import measure

    console, settings = Console(stderr=True), load_settings("hallway").of_log()
    prepare_kernels(settings, console, (*needed_parts(settings), LOCALIZATION))
    with console.status("bench") as status:
        rows = measure(logs, starts, status.update)
    return report(json, rows, rows_table("real buildings: errors of the place, m, and shares", rows))


def way_places(
    *, json: str = "way_places.json", rooms: int = 0, first: int = 42000, corridor: int = 0, kilometres: float = 0.0
) -> int:
    """Measure the place without a map in generated rooms without drums, in a bare corridor, and on a long way.

    Parameters
    ----------
    json
        File to write.
    rooms
        Number of rooms, each driven at three levels of odometry's errors.
    first
        Seed of the first room, of the corridor's first drive, and of the long way.
    corridor
        Number of drives there and back in a corridor of 60 m, by each model of reflection.
    kilometres
        Length of a way round blocks of corridors, km; only the graph of maps follows it.
    """
    if rooms <= 0 and corridor <= 0 and kilometres <= 0.0:
        raise UserError("nothing to measure: give --rooms, --corridor or --kilometres")
    use_kernel_cache()
    from bench.way_places import measure_corridor, measure_long, measure_rooms

    def rows(_: Settings, tell: Callable[[str], None]) -> dict[str, dict[str, float]]:
        found = measure_rooms(rooms, first, tell) if rooms > 0 else {}
        found |= measure_corridor(range(first, first + corridor), tell)
        return found | (measure_long(kilometres, first, tell) if kilometres > 0.0 else {})

    return try_in_rooms(
        rows, lambda found: rows_table("the place without a map: m, shares, ms", found), json,
        parts=(EMULATOR, LOCALIZATION),
    )  # fmt: skip
