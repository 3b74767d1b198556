"""Tests of the warm-up: it runs every kernel once, and a second process ends with the first."""

from __future__ import annotations

import contextlib
import importlib
import math
import os
import pkgutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from itertools import chain
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

import pytest
from numba.core import event
from rich.console import Console

import behaviors
import perception
from behaviors.valley import polar_histogram
from config.load import load_settings
from config.settings import Settings
from perception.bayes import bayes_method
from perception.bayes.tracks import polygon_tracks, refine
from perception.bayes.walls import points as wall_points
from perception.localization.drift import drift_correction, landmark_tracker
from perception.localization.known_room import pose_grid, pose_track
from perception.pipeline import Perception
from runtime.support import kernel_cache as kernels
from runtime.support import kernel_warmup
from tests.inner_kernels import is_inner, kernels_named

ROOT = Path(__file__).parents[3]


def test_the_compiler_is_imported_only_where_kernels_are_prepared() -> None:
    """It takes half a second, and reads the folder of its cache when it is imported: one beside the sources, then."""
    program = "import sys, runtime.cli.app, runtime.support.kernel_warmup; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", program], cwd=ROOT, check=False).returncode == 0


def test_the_second_process_compiles_the_refinement_of_its_part(monkeypatch: pytest.MonkeyPatch) -> None:
    """A call on an empty memory compiles and does nothing."""
    asked = []
    real = dict(vars(bayes_method))  # were it first imported now, it would keep the stubs
    for module, name in ((refine, "quantum"), (polygon_tracks, "polygon_quantum")):
        monkeypatch.setattr(module, name, lambda _s, _tracks, _p, _share, name=name: asked.append(name))
    kernel_warmup.compile_refinement(kernels.BAYES)
    kernel_warmup.compile_refinement(kernels.POLYGONS)
    assert asked == ["quantum", "polygon_quantum"]
    assert vars(bayes_method) == real


def test_a_second_process_that_hangs_is_killed(monkeypatch: pytest.MonkeyPatch) -> None:
    real, started = subprocess.Popen, []

    def hanging(_command: list[str], **streams: Any) -> subprocess.Popen[bytes]:
        started.append(real([sys.executable, "-c", "import time; time.sleep(600)"], **streams))
        return started[-1]

    monkeypatch.setattr(subprocess, "Popen", hanging)
    monkeypatch.setattr(kernel_warmup, "PARALLEL_MAX_S", 0.01)
    with kernel_warmup.compile_in_parallel(kernels.BAYES):
        assert started[0].poll() is None
    assert started[0].returncode is not None


LOOK = frozenset({"count_cuts", "enter_point_of_line"})
DRIFT = frozenset({"add_landmark", "remove_landmark"})
TRACKER = frozenset({"propagate", "update_with_firing"})
GRID = frozenset({"fill_cell", "score_block", "offer_peaks"})
HISTOGRAM = frozenset({"fill_cells", "cover"})
TRACK = frozenset({"add_hypothesis", "move", "update_particles", "conclude"})


def test_each_compiled_kernel_leaves_a_mark(tmp_path: Path) -> None:
    compiled, other = ({"dispatcher": kernel} for kernel in (refine.quantum, refine.refine))
    with kernel_warmup.marking_compiled_kernels(tmp_path), event.trigger_event("numba:compile", compiled):
        pass
    with event.trigger_event("numba:compile", other):
        pass
    assert [path.name for path in tmp_path.iterdir()] == [
        f"perception.bayes.tracks.refine.quantum{kernels.COMPILED_SUFFIX}"
    ]


@pytest.mark.parametrize(
    ("part", "names"),
    [
        (kernels.BAYES, {wall_points: LOOK}),
        (kernels.LOCALIZATION, {drift_correction: DRIFT, landmark_tracker: TRACKER}),
        (kernels.KNOWN_ROOM, {pose_grid: GRID, pose_track: TRACK}),
        (kernels.VALLEY, {polar_histogram: HISTOGRAM}),
    ],
)
def test_a_warm_up_runs_every_kernel_that_its_part_calls(
    part: str, names: dict[ModuleType, frozenset[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    done = set[str]()

    def note(name: str, call: Callable[..., Any]) -> Callable[..., Any]:
        def noted(*arguments: Any) -> Any:
            done.add(name)
            return call(*arguments)

        return noted

    for module, called in names.items():
        for name in called:
            monkeypatch.setattr(module, name, note(name, getattr(module, name)))
    kernel_warmup.RUN_ONCE[part](load_settings("hallway"))
    assert done == frozenset().union(*names.values())


def functions_of(package: ModuleType) -> Iterator[FunctionType]:
    """Yield the functions and methods of all modules of a package, without its kernels."""
    for found in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
        module = importlib.import_module(found.name)
        own = [value for value in vars(module).values() if getattr(value, "__module__", None) == found.name]
        within = [vars(value).values() for value in own if isinstance(value, type)]
        for value in (*own, *chain.from_iterable(within)):
            function = getattr(value, "fget", None) or getattr(value, "func", None) or value
            if isinstance(function, FunctionType):
                yield function


@pytest.mark.compiled
@pytest.mark.usefixtures("warm_kernels")
def test_every_kernel_that_python_calls_is_run_by_a_warm_up() -> None:
    """One that is not would be compiled within a cycle; this test finds it when nothing else has run it before."""
    called = {
        f"{kernel.__module__}.{kernel.__name__}, of {function.__qualname__}"
        for package in (perception, behaviors)
        for function in functions_of(package)
        for kernel in kernels_named(function)
        if is_inner(kernel)
    }
    assert called == set()


@pytest.mark.parametrize("part", [kernels.BAYES, kernels.PAPER])
def test_a_warm_up_observes_refines_and_edits(part: str, monkeypatch: pytest.MonkeyPatch) -> None:
    done = set[str]()

    def note(name: str, call: Callable[..., Any]) -> Callable[..., Any]:
        def noted(self: Perception, *arguments: Any) -> Any:
            done.update((name, *(type(edit).__name__ for edit in arguments if name == "edit")))
            return call(self, *arguments)

        return noted

    for name in ("observe", "refine", "edit", "evidence"):
        monkeypatch.setattr(Perception, name, note(name, getattr(Perception, name)))
    settings = load_settings("hallway")
    kernel_warmup.RUN_ONCE[part](settings)
    edits = {"PinSegments", "PlaceModel", "MoveObject", "ConfirmObject", "RemoveObject", "DeleteSegments", "ClearMap"}
    assert done == {"observe", "refine", "edit", "evidence", *edits}


def test_each_part_is_compiled_once_and_then_warmed_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.delenv("NUMBA_DISABLE_JIT", raising=False)
    happened: list[str] = []

    def compile_parts(_settings: Settings, folder: Path, parts: Sequence[str]) -> None:
        for part in parts:
            (folder / part).touch()
            happened.append(f"compile {part}")

    monkeypatch.setattr(kernel_warmup, "compile_parts", compile_parts)
    monkeypatch.setattr(kernel_warmup, "warm_up", lambda _settings, parts: happened.extend(parts))
    settings, console = load_settings("hallway"), Console(quiet=True)
    kernel_warmup.prepare_kernels(settings, console)
    assert happened == ["compile emulator", "compile ring", "compile bayes", "compile valley"]
    happened.clear()
    kernel_warmup.prepare_kernels(settings, console)
    assert happened == ["ring", "bayes", "valley"], "the emulator is another process"
    happened.clear()
    kernel_warmup.prepare_kernels(load_settings("hallway", models=["box"]), console)
    assert happened == ["compile polygons", "ring", "bayes", "valley"]
    folder = kernels.use_kernel_cache()
    (folder / kernels.BAYES).unlink()
    assert kernels.uncompiled_parts(folder, kernels.PARTS) == [
        kernels.BAYES, kernels.PAPER, kernels.LOCALIZATION, kernels.KNOWN_ROOM, kernels.SURFACES,
        kernels.ECHO_LAG, *kernels.GRIDS,
    ]  # fmt: skip
    happened.clear()
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    kernel_warmup.prepare_kernels(settings, console)
    assert happened == [], "there is nothing to compile"


@pytest.mark.parametrize(
    ("parts", "processors", "helped"),
    [
        ((kernels.EMULATOR, kernels.BAYES), 2, ["helper bayes", "observe_only"]),
        ((kernels.BAYES, kernels.POLYGONS), 2, ["helper polygons", "observe_only", "bayes"]),
        ((kernels.POLYGONS,), 2, []),
        ((kernels.EMULATOR, kernels.BAYES), 1, []),
    ],
)
def test_a_second_process_compiles_the_last_part(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, parts: tuple[str, ...], processors: int, helped: list[str]
) -> None:
    happened: list[str] = []

    @contextlib.contextmanager
    def compile_in_parallel(part: str) -> Iterator[None]:
        happened.append(f"helper {part}")
        yield
        happened.append("waited")

    def noted(name: str) -> Callable[[Settings], None]:
        return lambda _settings: happened.append(name)

    monkeypatch.setattr(kernel_warmup, "compile_in_parallel", compile_in_parallel)
    monkeypatch.setattr(kernel_warmup, "observe_only", noted("observe_only"))
    monkeypatch.setattr(kernel_warmup, "RUN_ONCE", {part: noted(part) for part in kernels.PARTS})
    monkeypatch.setattr(os, "cpu_count", lambda: processors)
    kernel_warmup.compile_parts(load_settings("hallway"), tmp_path, parts)
    assert happened == [*helped, *(["waited"] if helped else []), *parts]
    assert {path.name for path in tmp_path.iterdir()} == set(parts)


PREPARED = """
import sys
from runtime.support.kernel_cache import needed_parts, use_kernel_cache
from runtime.support.kernel_warmup import prepare_kernels
use_kernel_cache()
from config.load import load_model, load_settings
from rich.console import Console
settings = load_settings("hallway", sys.argv[1].split(), models=sys.argv[2].split(), world=sys.argv[3])
prepare_kernels(settings, Console(quiet=True))
from numba.core.dispatcher import Dispatcher
from behaviors.move_to_goal import Goal
from runtime.cycle.inputs import Request
from runtime.cycle.modes import Mode
from runtime.simulation.closed_loop import SimulationOptions, simulate
from runtime.cycle.inputs import OperatorInput

def signatures():
    # the emulator's kernels may still load: it is another process when it matters
    kernels = {
        id(kernel): kernel for name, module in list(sys.modules.items()) for kernel in vars(module).values()
        if name.startswith(("perception.", "behaviors.")) and isinstance(kernel, Dispatcher)
    }
    return {(each.__module__, each.__name__, str(types)) for each in kernels.values() for types in each.overloads}

before = signatures()
"""
UNPREPARED = """
from tests.runtime.emulated_run import Run

run = Run(settings, settings.world, 3, (), preparing="not at all")
run.until(10.0)
assert run.mode is Mode.DRIVE and run.truths[-1].pose.x > 0.0, run.state.mode
print(*sorted(signatures() - before))
"""
EDITED = """
from perception.edits import (
    ClearMap, ConfirmObject, DeleteSegments, MoveObject, PinSegments, PlaceModel, RemoveObject,
)
from runtime.console.frames.frame_encoder import FrameContext, FrameEncoder

further = settings.model_copy(update={"models": (*settings.models, load_model(sys.argv[4]))})
assert set(needed_parts(further)) <= set(needed_parts(settings))

encoder = FrameEncoder(settings)

def by_hand(cycle, state):
    # every half second one action after the other, also with a model that came late
    perception, arm = state.perception, Request.ARM if state.mode.mode is Mode.READY else None
    if cycle % 10 or state.odometry is None:
        return OperatorInput(arm)
    encoder.frame(state, None, FrameContext(host_s=0.0))
    seen = [o for o in perception.objects() if o.number is not None]
    for known in seen:
        perception.evidence(known.number)
    first = perception.segments().numbers[:4].tolist()
    x, y = state.odometry.pose.x, state.odometry.pose.y
    pose = (x + 1.5, y + 0.5, 0.3)
    edits = (
        [PlaceModel(m.name, *pose) for m in further.models[: None if cycle > 100 else -1]],
        [PinSegments(tuple(first), True)], [DeleteSegments(tuple(first[:2]))],
        [MoveObject(o.number, o.x + 0.2, o.y, 0.1) for o in seen], [ConfirmObject(o.number) for o in seen],
        [RemoveObject(o.number) for o in seen], [ClearMap()] if cycle > 200 else [],
    )
    return OperatorInput(arm, edits=tuple(edits[cycle // 10 % len(edits)]))

run = simulate(
    settings, settings.world, 0, 15.0, operator=by_hand,
    options=SimulationOptions(reload=lambda n: further if n == 100 else None),
)
assert run.state.cycle > 280 and run.state.odometry.pose.x > 1.0, run.state
print(*sorted(signatures() - before))
"""
TO_GOAL = """
def to_goal(cycle, state):
    arm = Request.ARM if state.mode.mode is Mode.READY else None
    return OperatorInput(arm, Goal(10.0, 0.0) if cycle == 20 else None)

run = simulate(settings, settings.world, 0, 15.0, operator=to_goal)
assert run.state.goal_drive.search.way, run.state
print(*sorted(signatures() - before))
"""


def added_in(script: str, *words: str) -> str:
    """Return the kernels of perception and behaviours that a drive loads after the preparation."""
    done = subprocess.run(
        [sys.executable, "-c", PREPARED + script, *words], cwd=ROOT, text=True, capture_output=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.mark.compiled
@pytest.mark.usefixtures("warm_kernels")
@pytest.mark.parametrize(
    ("sets", "models", "further"),
    [
        ("perception.method=bayes perception.localization.correct_drift=true", "semicircle box", "hexagon.toml"),
        *(
            pytest.param(*row, marks=pytest.mark.soak)
            for row in [
                ("perception.method=bayes", "semicircle", "keg.toml"),
                ("perception.method=bayes", "semicircle box", "hexagon.toml"),
                ("perception.localization.correct_drift=true", "semicircle", "keg.toml"),
                ("perception.method=paper", "semicircle", "box"),
            ]
        ),
    ],
)
def test_no_kernel_is_compiled_or_loaded_while_the_robot_drives_and_a_person_edits(
    tmp_path: Path, sets: str, models: str, further: str
) -> None:
    hexagon = [[math.cos(a), math.sin(a)] for a in (k * math.pi / 3.0 for k in range(6))]
    (tmp_path / "hexagon.toml").write_text(f'name = "hexagon"\nclosed = true\nvertices_m = {hexagon}\n')
    (tmp_path / "keg.toml").write_text(f'name = "keg"\nclosed = true\narc_radius_m = 1.0\nvertices_m = {hexagon}\n')
    further = str(tmp_path / further) if "." in further else further
    assert added_in(EDITED, sets, models, "hallway", further) == ""


@pytest.mark.compiled
@pytest.mark.usefixtures("warm_kernels")
def test_a_drive_without_recognition_loads_the_kernels_of_the_ring_only() -> None:
    """Those are compiled first, and the robot drives with them while all others are compiled."""
    ring = "prepare_kernels(settings, Console(quiet=True), ['ring'])"
    only = PREPARED.replace("prepare_kernels(settings, Console(quiet=True))", ring)
    done = subprocess.run(
        [sys.executable, "-c", only + UNPREPARED, "", "semicircle", "hallway"], cwd=ROOT, text=True,
        capture_output=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stdout.strip()) == (0, ""), done.stderr


@pytest.mark.compiled
@pytest.mark.usefixtures("warm_kernels")
def test_no_kernel_is_compiled_or_loaded_on_the_way_to_a_goal_among_walls() -> None:
    assert added_in(TO_GOAL, "perception.grid.method=directed", "semicircle", "office") == ""
