"""False drums in rooms without a drum, by both models of reflection, with boxes alone and among clutter."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Final, get_args

from bench.trials.drumless_rooms import NOISE_RELATIVE, drumless_room
from bench.trials.false_drum_trials import try_room
from config.settings import Settings
from config.world import AcousticsConfig
from perception.localization.room.expected_ranges import Reflection

MINUTE_S: Final = 60.0


def measure(
    settings: Settings, seeds: Iterable[int], minutes: float, furniture: Iterable[str], report: Callable[[str], None]
) -> dict[str, dict[str, float]]:
    """Return the figures of all rooms, by model of reflection and furniture.

    Parameters
    ----------
    settings
        Ring, models and perception.
    seeds
        Which rooms.
    minutes
        Duration of each drive.
    furniture
        "boxes" for two boxes, "clutter" for these and clutter.
    report
        Called with a line on what is running.
    """
    rows = {}
    seeds, kinds = tuple(seeds), tuple(furniture)
    for reflection in get_args(Reflection):
        acoustics = AcousticsConfig(model=reflection, noise_relative=NOISE_RELATIVE)
        for kind in kinds:
            trials = []
            for seed in seeds:
                report(f"false drums: {reflection}, {kind}, room {seed}")
                room = drumless_room(seed, acoustics, is_cluttered=kind == "clutter")
                trials.append(try_room(settings, room, seed, MINUTE_S * minutes))
            looks = sum(trial.looks for trial in trials)
            driven = sum(trial.duration_s for trial in trials) / MINUTE_S
            drums = [drum for trial in trials for drum in trial.drums.values()]
            rows[f"{reflection}, {kind}"] = {
                "rooms": len(trials),
                "looks": looks,
                "false per 1,000": 1e3 * sum(trial.false_looks for trial in trials) / max(looks, 1),
                "rooms with a false drum": sum(len(trial.drums) > 0 for trial in trials),
                "false drums": len(drums),
                "a minute": len(drums) / max(driven, 1.0 / MINUTE_S),
                "longest, s": max((drum.last_s - drum.first_s for drum in drums), default=0.0),
            }
    return rows
