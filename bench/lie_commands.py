"""The measurement of robots that lie, and of the false alarms of robots that do not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict

from rich.console import Console

from bench.table import report
from config.load import load_settings
from runtime.support.kernel_cache import use_kernel_cache
from runtime.support.kernel_warmup import prepare_kernels


def few_sensors(
    *,
    json: str = "few-sensors.json",
    robots: str = "front-1,hobby3,front-5,hobby8,round-12,parking12",
    rooms: int = 20,
    first: int = 0,
    minutes: float = 10.0,
) -> int:
    """Drive robots with few sensors from goal to goal: contacts, arrivals, drums; among mirrors and among echoes.

    Parameters
    ----------
    json
        File to write.
    robots
        Shipped robots and those of `bench.sparse_rings`, with commas between them.
    rooms, first
        Number of rooms, and the first one's seed.
    minutes
        Length of the drives in each room.
    """
    use_kernel_cache()
    from bench.few_sensors import few_sensors_table, measure

    console = Console(stderr=True)
    prepare_kernels(load_settings("hallway"), console)
    with console.status("bench") as status:
        results = measure(robots.split(","), range(first, first + max(1, rooms)), 60.0 * minutes, status.update)
    return report(json, [asdict(one) for one in results], few_sensors_table(results))


def lies(
    *,
    json: str = "lies.json",
    robots: str = "",
    rooms: str = "room,office,hallway,furnished",
    kinds: str = "",
    seeds: int = 1,
    first: int = 0,
    moments: int = 5,
    honest: bool = False,
    recognise: bool = False,
) -> int:
    """Drive robots that lie through rooms, with the truth of contacts.

    Parameters
    ----------
    json
        File to write.
    robots, kinds
        Names with commas between them; all shipped robots, and all kinds of lies, if not given; "built": the faults
        that robots are built with. `bench.sparse_rings` has robots with blind sides: front-4, front-6, front-9,
        front-back, left-6.
    rooms
        Of room, office, hallway, furnished, goal and corridor.
    seeds, first
        Number of generated rooms, and the first one's seed.
    moments
        At how many random moments each lie begins.
    honest
        Drive without a lie, two minutes each, and count the stops.
    recognise
        Run recognition as well, which takes most of the time.
    """
    use_kernel_cache()
    from bench.lies import BUILT, KINDS, ROBOTS, lies_table, measure, trials
    from bench.lies import honest as honest_plans

    console = Console(stderr=True)
    prepare_kernels(load_settings("hallway"), console)
    chosen, where = robots.split(",") if robots else ROBOTS, rooms.split(",")
    numbers, moments = range(first, first + max(1, seeds)), max(1, moments)
    named_kinds: dict[str, Sequence[str]] = {"": tuple(KINDS), "built": tuple(BUILT)}
    plans = (
        honest_plans(chosen, where, numbers, moments)
        if honest
        else trials(chosen, where, named_kinds.get(kinds, kinds.split(",")), numbers, moments)
    )
    with console.status("bench") as status:
        results = measure(plans, status.update, recognises=recognise)
    return report(json, [asdict(one) for one in results], lies_table(results))
