"""Tests of the warm-up: it runs every kernel once, and a second process ends with the first."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from numba.core import event

from config.load import load_settings
from perception.bayes import polygon_tracks, refine
from perception.localization import drift_correction, landmark_tracker, pose_grid, pose_track
from perception.pipeline import Perception
from runtime.support import kernel_cache as kernels
from runtime.support import kernel_warmup


def test_the_second_process_compiles_the_refinement_of_its_part(monkeypatch: pytest.MonkeyPatch) -> None:
    """A call on an empty memory compiles and does nothing."""
    asked = []
    for module, name in ((refine, "quantum"), (polygon_tracks, "polygon_quantum")):
        monkeypatch.setattr(module, name, lambda _s, _tracks, _p, _share, name=name: asked.append(name))
    kernel_warmup.compile_refinement(kernels.BAYES)
    kernel_warmup.compile_refinement(kernels.POLYGONS)
    assert asked == ["quantum", "polygon_quantum"]


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


DRIFT = frozenset({"add_landmark", "remove_landmark"})
TRACKER = frozenset({"propagate", "update_with_firing"})
GRID = frozenset({"fill_cell", "score_block", "offer_peaks"})
TRACK = frozenset({"add_hypothesis", "move", "update_particles", "conclude"})


def test_each_compiled_kernel_leaves_a_mark(tmp_path: Path) -> None:
    compiled, other = ({"dispatcher": kernel} for kernel in (refine.quantum, refine.refine))
    with kernel_warmup.marking_compiled_kernels(tmp_path), event.trigger_event("numba:compile", compiled):
        pass
    with event.trigger_event("numba:compile", other):
        pass
    assert [path.name for path in tmp_path.iterdir()] == [f"perception.bayes.refine.quantum{kernels.COMPILED_SUFFIX}"]


@pytest.mark.parametrize(
    ("part", "names"),
    [
        (kernels.LOCALIZATION, {drift_correction: DRIFT, landmark_tracker: TRACKER}),
        (kernels.KNOWN_ROOM, {pose_grid: GRID, pose_track: TRACK}),
    ],
)
def test_the_warm_up_of_localization_runs_every_kernel_that_it_calls(
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
