"""Run every kernel once, part by part: this compiles a kernel that was never compiled, and loads one that was.

Two processes that compile the same kernel do the same work twice. So the second process begins with what the first
one compiles last: `python -m runtime.support.kernel_warmup bayes` compiles the refinement of circles, the edits, and
what walls need now and then; `… polygons` the refinement of polygons; and `… bayes,emulator whole` everything that
these parts need, in this order, for a robot whose process has already started.
"""

from __future__ import annotations

import contextlib
import gc
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

from runtime.support.child_process import INTERPRETER, child_environment
from runtime.support.kernel_cache import (
    BAYES,
    COMPILED_SUFFIX,
    ECHO_LAG,
    EMULATOR,
    GRIDS,
    KNOWN_ROOM,
    LOCALIZATION,
    PAPER,
    POLYGONS,
    RING,
    SURFACES,
    VALLEY,
    is_interpreted,
    needed_parts,
    uncompiled_parts,
    use_kernel_cache,
)
from runtime.support.localization_warmup import WARM_UP_FIRINGS, correct_drift, find_echo_lag, find_in_room
from runtime.support.progress import progress

if TYPE_CHECKING:
    from pathlib import Path

    from rich.console import Console

    from config.model import ModelConfig
    from config.settings import Settings
    from perception.bayes.memory.settings_record import SettingsRecord
    from perception.bayes.memory.state import Memory
    from perception.pipeline import Perception

GARBAGE_MAX: Final = 100_000
"""Objects from one garbage collection to the next while compiling: with Python's own 700, a tenth of the time goes
into collections that find little."""
PARALLEL_MAX_S: Final = 300.0
"""Time limit for the second process."""


def _perception(settings: Settings, method: str, models: Sequence[ModelConfig]) -> Perception:
    from perception.pipeline import Perception

    eager = settings.perception.clusters.model_copy(update={"segments_min": 1})
    config = settings.perception.model_copy(update={"clusters": eager, "method": method})
    return Perception(settings.ring, models, config)


def _drive(
    settings: Settings, perception: Perception, firings: int = WARM_UP_FIRINGS, *, refines: bool = True
) -> None:
    """Drive past a wall."""
    import numpy as np

    from drivers.messages import CrossPaths, Firing, Pose

    count = len(settings.ring.mounts)
    heard = CrossPaths(np.array([0]), np.array([1 % count]), np.array([2.0]))  # the next robot may listen
    for k in range(firings):
        ranges = np.full(count, 2.0)
        perception.observe(Firing(0.1 * k, Pose(0.1 * k, 0.0, 0.0), 0.0, ranges, heard))
        while refines and perception.can_refine:
            perception.refine()
    perception.labelled_objects()
    perception.segment_geometry()
    perception.surroundings(0.1 * firings, 0.0, Pose(0.0, 0.0, 0.0), 1.0)
    perception.counts  # noqa: B018 - a property that runs kernels


def _ring(settings: Settings) -> None:
    """Drive past a wall without recognition, as at the start of a run; test a turn, and report on a sensor."""
    import numpy as np

    from drivers.messages import Pose
    from perception.pipeline import Perception
    from perception.records import records, zeros
    from perception.ring_faults.wiring import LOOK_FIELDS, LOOKS, Wiring, weigh_turn
    from perception.sensor_faults.memory import RingMemory, SensorMemory
    from perception.sensor_faults.silence import miss_share
    from perception.sensor_mounts import mounts_array, turn_mounts

    perception = Perception(settings.ring, settings.models, settings.perception, recognises=False)
    _drive(settings, perception, refines=False)
    mounts = mounts_array(settings.ring.mounts)[:1]
    turn_mounts(mounts, np.zeros(1, np.bool_), 0.0, mounts)
    looks = Wiring(np.zeros((1, LOOKS, LOOK_FIELDS)), np.zeros(1, np.int64), np.zeros((1, 1)))
    weigh_turn(mounts, (0.2, 0.1, 1.0), looks, np.zeros((LOOKS, 3)), np.zeros((1, 2)))
    miss_share(records(SensorMemory, zeros(SensorMemory, 1))[0], records(RingMemory, zeros(RingMemory, 1))[0])
    perception.steady_obstacles(0.1 * WARM_UP_FIRINGS, 1.0, Pose(0.0, 0.0, 0.0))
    perception.unheard.take_ahead(Pose(0.0, 0.0, 0.0), 1.0, 1.0)
    perception.unheard.points()
    perception.unheard.remembered.ahead(Pose(0.0, 0.0, 0.0), 1.0)
    perception.ring_monitor.possible_obstacles()


def _grid(settings: Settings, method: str) -> None:
    """Drive past a wall with an evidence grid, and ask for it."""
    grid = settings.perception.grid.model_copy(update={"method": method})
    with_grid = settings.model_copy(update={"perception": settings.perception.model_copy(update={"grid": grid})})
    perception = _perception(with_grid, settings.perception.method, settings.models)
    _drive(settings, perception, refines=False)
    perception.occupancy()


def _surfaces(settings: Settings) -> None:
    """Drive past a wall and map it as a surface; leave the map, and go on in the midst of a search."""
    from perception.mapping.surfaces.piece_fit import group_echoes
    from perception.mapping.surfaces.pieces import order_cells
    from perception.mapping.surfaces.quantum import end_search
    from perception.mapping.surfaces.records import CellCounts, LocalMap
    from perception.records import records, zeros

    perception = _perception(settings.of_log(), BAYES, settings.models)
    _drive(settings, perception)
    perception.surfaces.finish()
    perception.polylines()
    perception.restore(perception.snapshot())
    room, counts = records(LocalMap, zeros(LocalMap, 1)), records(CellCounts, zeros(CellCounts, 1))
    for kernel in (end_search, order_cells, group_echoes):
        kernel(room, counts)


def _square() -> ModelConfig:
    from config.model import ModelConfig

    corners = ((1.0, -1.0), (1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0))
    return ModelConfig(name="warm-up", closed=True, vertices_m=corners)


def _edit(settings: Settings, perception: Perception, models: Sequence[ModelConfig], firings: int) -> None:
    """Do every kind of edit with each model, and drive in between: the operator's first must not delay a cycle."""
    from perception import edits
    from perception.paper.cluster_view import ClusterView

    ClusterView(settings.perception).boxes(perception.segments().geometry)  # the console shows them for either method
    numbers = tuple(perception.segments().numbers[:2].tolist())
    perception.edit(edits.PinSegments(numbers, pinned=True))
    _drive(settings, perception, firings)  # its segments overwrite the pinned ones, which are put back
    for model in models:
        perception.edit(edits.PlaceModel(model.name, 1.0, 2.5, 0.0))
    for seen in perception.objects():
        if seen.number is not None:
            perception.evidence(seen.number)
            perception.edit(edits.MoveObject(seen.number, 1.1, 2.5, 0.0))
            perception.edit(edits.MoveObject(seen.number, 9.0, 9.0, 0.0))
            perception.edit(edits.ConfirmObject(seen.number))
            perception.edit(edits.RemoveObject(seen.number))
    perception.edit(edits.DeleteSegments(numbers))
    perception.edit(edits.ClearMap())


def _drive_and_edit(settings: Settings, method: str, models: Sequence[ModelConfig]) -> None:
    perception = _perception(settings, method, models)
    _drive(settings, perception)
    _edit(settings, perception, models, WARM_UP_FIRINGS)


def observe_only(settings: Settings) -> None:
    """Drive past a wall without refinement."""
    _drive(settings, _perception(settings, BAYES, settings.models), refines=False)


def _circles(settings: Settings) -> None:
    """Drive past a wall, do every edit, and call what a report on walls and points may call by itself."""
    from perception.bayes.inference.kernel_settings import make_settings
    from perception.bayes.memory.state import Memory
    from perception.bayes.walls.bins import bin_of

    _drive_and_edit(settings, BAYES, settings.models)
    bin_of(0.0)  # the report on walls calls it by itself
    bayes = settings.perception.bayes
    memory = Memory(len(settings.ring.mounts), bayes.tracks_max)
    _look_for_points(memory, make_settings(settings.ring, settings.models, bayes))


def _look_for_points(memory: Memory, constants: SettingsRecord) -> None:
    """Look for corners and edges on the line of a wall, as where mirrors are known."""
    import numpy as np

    from perception.bayes.walls.points import LINE_CELLS, count_cuts, enter_point_of_line

    count_cuts(memory.s, constants, 0, np.zeros((2, LINE_CELLS)))
    enter_point_of_line(memory.s, constants, 0, 0.0, False)  # noqa: FBT003 - a kernel takes no keywords


def _polygons(settings: Settings, method: str = BAYES) -> None:
    _drive_and_edit(settings, method, (*settings.models, _square()))


def _emulator(settings: Settings) -> None:
    """Let an emulated robot fire at a drum and a wall in each kind of acoustics."""
    from config.world import DrumConfig, WallConfig, WorldConfig
    from drivers.registry import make_device

    for model in ("cone", "specular", "rays"):
        acoustics = WorldConfig().acoustics.model_copy(update={"model": model, "crosstalk": 0.5})
        world = WorldConfig(
            drum=(DrumConfig(x_m=2.0, y_m=0.0, radius_m=0.3),),
            wall=(WallConfig(x1_m=3.0, y1_m=-3.0, x2_m=3.0, y2_m=3.0),),
            acoustics=acoustics,
        )
        make_device(settings, world, seed=0).advance(0.5)


def _valley(settings: Settings) -> None:
    """Choose among the valleys before an echo."""
    import numpy as np

    from behaviors.valley.polar_histogram import cells_near, crossed
    from perception.percept import FieldOfView, Percept, Pose

    nothing = np.empty(0)
    view = FieldOfView(nothing, nothing, nothing, nothing, 0.1, 1.0, 1.0)
    percept = Percept(Pose(0.0, 0.0, 0.0), np.array([[1.0, 0.0]]), view)
    crossed(cells_near(percept, 0.0, 0.0, 2.0, settings.behaviors.follow_valley), (0.5,), (1.0,))


RUN_ONCE: Final[Mapping[str, Callable[[Settings], None]]] = MappingProxyType({
    EMULATOR: _emulator, RING: _ring, BAYES: _circles, POLYGONS: _polygons, PAPER: partial(_polygons, method=PAPER),
    LOCALIZATION: correct_drift, KNOWN_ROOM: find_in_room, VALLEY: _valley, SURFACES: _surfaces,
    ECHO_LAG: find_echo_lag,    **{method: partial(_grid, method=method) for method in GRIDS},
})  # fmt: skip
"""Runs each part once."""


@contextlib.contextmanager
def marking_compiled_kernels(folder: Path) -> Iterator[None]:
    """Leave a file in this folder for each kernel that is compiled meanwhile."""
    from numba.core import event

    class Marker(event.Listener):  # type: ignore[misc]  # numba has no types
        def on_start(self, _started: event.Event) -> None:
            pass

        def on_end(self, ended: event.Event) -> None:
            kernel = ended.data["dispatcher"]
            with contextlib.suppress(OSError):  # only the progress shown depends on it
                (folder / f"{kernel.__module__}.{kernel.__name__}{COMPILED_SUFFIX}").touch()

    with event.install_listener("numba:compile", Marker()):
        yield


class CompilationEnded(Exception):  # noqa: N818 - no error: what needs the kernels has ended
    """Raised by a function of `following_kernels` to compile no further kernel."""


@contextlib.contextmanager
def following_kernels(on_kernel: Callable[[int], None]) -> Iterator[None]:
    """Call a function before each kernel that this thread compiles, with how many it has compiled before."""
    from numba.core import event

    class Follower(event.Listener):  # type: ignore[misc]  # numba has no types
        done = 0
        thread = threading.get_ident()

        def on_start(self, _started: event.Event) -> None:
            if threading.get_ident() == self.thread:
                on_kernel(self.done)

        def on_end(self, _ended: event.Event) -> None:
            self.done += threading.get_ident() == self.thread

    with event.install_listener("numba:compile", Follower()):
        yield


@contextlib.contextmanager
def compile_in_parallel(part: str) -> Iterator[None]:
    """Compile the refinement of `part` in another process meanwhile, and wait for it at the end."""
    null = subprocess.DEVNULL
    process = subprocess.Popen(  # noqa: S603 - this very program
        [*INTERPRETER, "-m", "runtime.support.kernel_warmup", part],
        stdin=null,
        stdout=null,
        stderr=null,
        env=child_environment(),
    )
    try:
        yield
        # If it failed, this process compiles what is missing.
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(PARALLEL_MAX_S)
    finally:
        process.kill()
        process.wait()


def compile_refinement(part: str) -> None:
    """Compile the refinement of a part, for circles also edits and walls, by calls on an empty state."""
    from config.load import load_settings
    from perception.bayes.inference.kernel_settings import make_settings
    from perception.bayes.memory.state import Memory
    from perception.bayes.tracks.polygon_tracks import polygon_quantum
    from perception.bayes.tracks.refine import quantum
    from perception.bayes.walls.corners import find_corners
    from perception.bayes.walls.initiation import best_line
    from perception.bayes.walls.merging import drop_explained
    from perception.bayes.walls.review import review

    settings = load_settings(None)
    bayes = settings.perception.bayes
    memory = Memory(len(settings.ring.mounts), bayes.tracks_max)
    refine = {BAYES: quantum, POLYGONS: polygon_quantum}[part]
    constants = make_settings(settings.ring, settings.models, bayes)
    refine(memory.s, memory.tracks, constants, bayes.fresh_share)
    if part == BAYES:
        _edit(settings, _perception(settings, BAYES, settings.models), settings.models, 0)
        best_line(memory.s, constants, 0)
        drop_explained(memory.s, memory.tracks, constants, 0)
        find_corners(memory.s)
        review(memory.s, memory.tracks, constants, 0)
        _look_for_points(memory, constants)


def warm_up(settings: Settings, parts: Iterable[str]) -> None:
    """Run every kernel of these parts once, the operator's edits included, so that no cycle compiles or loads one."""
    for part in parts:
        RUN_ONCE[part](settings)


def prepare_kernels(settings: Settings, console: Console, parts: Iterable[str] | None = None) -> None:
    """Load every kernel, and first compile those that never were, with a notice that this takes a while.

    Parameters
    ----------
    settings : Settings
        Ring, models and constants of the run.
    console : Console
        Where the notice is shown.
    parts : iterable of str, optional
        Of `PARTS`; by default those that a run with these settings needs.
    """
    folder = use_kernel_cache()
    if is_interpreted():
        return
    parts = needed_parts(settings) if parts is None else tuple(parts)
    uncompiled = uncompiled_parts(folder, parts)
    if not uncompiled:
        warm_up(settings, (part for part in parts if part != EMULATOR))
        return
    with progress(console, "compiling kernels; this happens once"):
        compile_parts(settings, folder, uncompiled)
        warm_up(settings, (part for part in parts if part not in {*uncompiled, EMULATOR}))


def compile_parts(settings: Settings, folder: Path, parts: Sequence[str]) -> None:
    """Compile these parts and mark them as compiled, in two processes where there are two processors.

    `folder` is that of `use_kernel_cache`.
    """
    if BAYES in parts and (os.cpu_count() or 1) > 1:
        # What the other process compiles is in the cache afterwards; this one starts with what shares none of it.
        with compile_in_parallel(POLYGONS if POLYGONS in parts else BAYES):
            observe_only(settings)
            if POLYGONS in parts:
                RUN_ONCE[BAYES](settings)
    for part in parts:
        warm_up(settings, [part])
        (folder / part).touch()


def compile_whole(parts: Sequence[str]) -> None:
    """Compile all kernels of these parts, in this order."""
    from config.load import load_settings

    compile_parts(load_settings(None), use_kernel_cache(), parts)


if __name__ == "__main__":
    gc.set_threshold(GARBAGE_MAX)
    with marking_compiled_kernels(use_kernel_cache()):
        if sys.argv[2:] == ["whole"]:
            compile_whole(sys.argv[1].split(","))
        else:
            compile_refinement(sys.argv[1])
