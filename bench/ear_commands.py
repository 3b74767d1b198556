"""Measurements of listening sensors: the emulator's cross paths, and what one stand says of a surface."""

from __future__ import annotations

from rich.console import Console

from bench.table import report, rows_table, wide
from config.load import load_robot
from runtime.simulation.scene_names import SceneName
from runtime.support.kernel_cache import use_kernel_cache


def cross_paths(*, json: str = "cross_paths.json", rooms: int = 30, first: int = 0) -> int:
    """Compare the emulator's cross paths with an independent simulator of bursts and a threshold.

    Parameters
    ----------
    json
        File to write.
    rooms
        Number of random rooms with walls, corners and posts.
    first
        Seed of the first room.
    """
    from bench.cross_paths import measure

    with Console(stderr=True).status("bench") as status:
        rows = measure(range(first, first + max(1, rooms)), status.update)
    return report(json, rows, rows_table("cross paths: the emulator and bursts of sound", rows))


def ear_halls(
    *, json: str = "ear_halls.json", scene: list[SceneName] | None = None, ring: list[str] | None = None,
    seeds: int = 2, first: int = 700, sure: float | None = None,
) -> int:  # fmt: skip
    """Measure first sure fixes, wrong names, drums found and cost in the halls, with and without listening sensors.

    Parameters
    ----------
    json
        File to write.
    scene
        Scenes; those of the requirement if not given.
    ring
        Rings: "ears", "ears, no listeners", "denning"; all if not given.
    seeds
        Seeds of each scene; `moved` and `jit10` have ten halls a seed, the others one.
    first
        The first of them.
    sure
        Probability from which on a drum is reported, near and far; that of the settings if not given.
    """
    from bench.ear_halls import SCENES, measure, rings, settings_of

    chosen = {name: one for name, one in rings().items() if ring is None or name in ring}
    rows = {}
    with Console(stderr=True).status("bench") as status:
        for what in scene or SCENES:
            for name, one in chosen.items():
                rows[f"{what}, {name}"] = measure(
                    what, settings_of(one, sure), range(first, first + max(1, seeds)), status.update
                )
    return report(json, rows, rows_table("the halls with listening sensors", rows))


def one_stand(*, json: str = "one_stand.json", scenes: int = 20, first: int = 1000, rounds: int = 1) -> int:
    """Measure how well one stand gives kind and place of a surface, with ranges of 1 mm and of a tenth of a foot.

    Parameters
    ----------
    json
        File to write.
    scenes
        Random scenes of each kind: wall, corner, edge, drum, post.
    first
        Seed of the first one.
    rounds
        Rounds of the firing pattern in a stand.
    """
    from bench.one_stand import TENTH_FT_M, measure

    ring = load_robot("ears").ring
    rows, tables = {}, []
    with Console(stderr=True).status("bench") as status:
        for name, resolution_m in (("1 mm", ring.resolution_m), (".1 ft", TENTH_FT_M)):
            coarse = ring.model_copy(update={"resolution_m": resolution_m})
            counts, rows[name] = measure(coarse, rounds, max(1, scenes), first, status.update)
            tables.append(rows_table(f"what scenes are called, ranges of {name}", counts))
    for table in tables:
        wide().print(table)
    return report(json, rows, rows_table("one stand", rows))


def stand_bound(*, json: str = "stand_bound.json") -> int:
    """Print how well one stand can tell edge, post and drum apart at all, with listeners as shipped and with all.

    Parameters
    ----------
    json
        File to write.
    """
    from bench.stand_bound import bounds

    ring = load_robot("ears").ring
    rows = {
        f"{what}{name}": row
        for what, everyone in (("", False), ("all listen: ", True))
        for name, row in bounds(ring, everyone=everyone).items()
    }
    return report(json, rows, rows_table("one stand: the least error of any rule", rows))


def naming_bound(*, json: str = "naming_bound.json", seed: int = 700) -> int:
    """Print how many posts, barrels and edges any rule names that names 95 % of the drums 4 ft ahead of them.

    Parameters
    ----------
    json
        File to write.
    seed
        Of the scenes.
    """
    from bench.naming_bound import bounds

    scenes: tuple[SceneName, ...] = ("noisy", "jit10", "moved")
    rows: dict[str, dict[str, float]] = {name: bounds(name, seed) for name in scenes}
    return report(json, rows, rows_table("named 4 ft before, with listeners", rows))


def ear_cost(
    *, json: str = "ear_cost.json", scene: list[SceneName] | None = None, seeds: int = 2, first: int = 700
) -> int:
    """Measure what a firing of eight sensors costs, with sixteen listeners and without, in turns.

    Parameters
    ----------
    json
        File to write.
    scene
        Scenes; those of the requirement if not given.
    seeds
        Seeds of each scene, of which only the first hall counts.
    first
        The first of them.
    """
    from bench.ear_halls import SCENES, costs

    rows: dict[str, dict[str, float]] = {}
    with Console(stderr=True).status("bench") as status:
        for what in scene or SCENES:
            status.update(what)
            rows |= costs(what, range(first, first + max(1, seeds)))
    return report(json, rows, rows_table("a firing of eight sensors", rows))


def servo(*, json: str = "servo.json", stands: int = 20, halls: int = 1, first: int = 0) -> int:
    """Measure what one sensor on a servo finds: drums and walls at a stand, and drums in a drive at .15 m/s.

    Parameters
    ----------
    json
        File to write.
    stands
        Stands among two drums and two walls, by each robot and model of the reflection.
    halls
        Seeds of ten halls with moved drums each, to drive through.
    first
        The first seed.
    """
    from bench.servo import measure_drives, measure_stands

    use_kernel_cache()
    with Console(stderr=True).status("bench") as status:
        rows = measure_stands(range(first, first + max(1, stands)), status.update)
        report(json, rows, rows_table("one stand of a sensor on a servo, and of the Denning", rows))
        if halls > 0:
            drives = measure_drives(range(first, first + halls), status.update)
            return report(json, {**rows, **drives}, rows_table("drives at .15 m/s", drives))
    return 0
