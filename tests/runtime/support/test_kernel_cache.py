"""Tests of the kernel cache: a folder for each version of the sources, in the first place that is writable."""

from __future__ import annotations

import contextlib
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from importlib.machinery import ModuleSpec
from pathlib import Path

import pytest
from rich.console import Console

import runtime.support.kernel_cache as kernels
from config.errors import UserError
from config.load import load_settings, with_known_room
from config.settings import Settings
from runtime.support import kernel_warmup as warming

ROOT = Path(__file__).parents[3]


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return an empty cache folder; temporary files go to a folder of the test as well."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    (tmp_path / "tmp").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "tmp"))
    return tmp_path / "cache"


def packages(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Put two packages in place of the real ones; return a source of the second."""
    for name in kernels.PACKAGES:
        (folder / name).mkdir(parents=True)
        (folder / name / "a.py").write_text("X = 1\n")

    def find(name: str) -> ModuleSpec:
        spec = ModuleSpec(name, None, is_package=True)
        spec.submodule_search_locations = [str(folder / name)]
        return spec

    monkeypatch.setattr(kernels, "find_spec", find)
    return folder / kernels.PACKAGES[1] / "a.py"


def test_the_same_sources_have_the_same_folder(home: Path) -> None:
    folder = kernels.cache_folder()
    assert folder == kernels.cache_folder()
    assert folder.is_dir()
    assert folder.is_relative_to(home / "echolocate" / "kernels")
    assert list(folder.iterdir()) == []


def test_a_changed_byte_of_a_source_changes_the_folder(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source = packages(home.parent / "sources", monkeypatch)
    first = kernels.cache_folder()
    source.write_text("X = 2\n")
    second = kernels.cache_folder()
    assert first != second
    source.write_text("X = 1\n")
    assert kernels.cache_folder() == first
    source.with_name("b.py").write_text("")
    (source.parent / "notes.txt").write_text("no source")
    assert kernels.cache_folder() == first, "an empty file and a note change no kernel"
    source.with_name("b.py").write_text("Y = 3\n")
    assert kernels.cache_folder() not in {first, second}


@pytest.mark.usefixtures("home")
def test_two_installations_of_the_same_sources_do_not_share_marks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Numba files kernels by the path of their source: what one has compiled, the other has not."""
    first = kernels.cache_folder()
    monkeypatch.setattr(kernels, "__file__", "/opt/echolocate/runtime/support/kernel_cache.py")
    assert kernels.cache_folder() != first


def test_kernels_with_checked_bounds_are_kept_apart(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Numba's own key does not hold this setting: it would load kernels without checks."""
    monkeypatch.delenv("NUMBA_BOUNDSCHECK", raising=False)
    plain = kernels.cache_folder()
    monkeypatch.setenv("NUMBA_BOUNDSCHECK", "1")
    assert kernels.cache_folder() != plain
    assert plain.is_relative_to(home)


def test_every_package_with_kernels_is_hashed() -> None:
    holders = {
        path.parent
        for room in ("perception", "drivers", "behaviors", "runtime")
        for path in (ROOT / room).rglob("*.py")
        if "@kernel" in path.read_text("utf-8") or "njit" in path.read_text("utf-8")
    }
    assert holders == {ROOT.joinpath(*name.split(".")) for name in kernels.PACKAGES}


def private(folder: Path, home: Path) -> bool:
    """Return whether this is a new, private folder outside the user's cache."""
    return folder.parent == home.parent / "tmp" and folder.stat().st_mode & 0o777 == 0o700


def test_an_unwritable_cache_is_replaced_by_a_new_private_folder(home: Path) -> None:
    home.write_text("a file is no folder, not even for root")
    folder = kernels.cache_folder()
    assert private(folder, home)
    assert kernels.cache_folder() != folder, "its name cannot be known beforehand"


@pytest.mark.promise("P17")
@pytest.mark.parametrize("depth", [0, 1, 2])
@pytest.mark.parametrize("how", ["others can write", "a link", "another owner"])
def test_a_cache_into_which_others_could_plant_code_is_not_used(
    home: Path, monkeypatch: pytest.MonkeyPatch, depth: int, how: str
) -> None:
    folder = kernels.cache_folder()
    assert folder.is_relative_to(home)
    planted = (folder, *folder.parents)[depth]
    if how == "others can write":
        planted.chmod(0o770)
    elif how == "a link":
        planted.rename(home.parent / "theirs")
        planted.symlink_to(home.parent / "theirs")
    else:
        lstat = Path.lstat
        fields = os.stat_result(lstat(planted))

        def of_another(path: Path) -> os.stat_result:
            found = list(lstat(path))
            found[4] = fields.st_uid + (path == planted)
            return os.stat_result(found)

        monkeypatch.setattr(Path, "lstat", of_another)
    assert private(kernels.cache_folder(), home)


def test_a_folder_in_place_of_the_cache_is_removed_at_the_end(home: Path) -> None:
    home.write_text("a file is no folder")
    program = "from runtime.support.kernel_cache import cache_folder; print(cache_folder())"
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "TMPDIR": str(home.parent / "tmp")}
    done = subprocess.run(
        [sys.executable, "-c", program], env=environment, capture_output=True, text=True, timeout=600, check=True
    )
    assert private_name(done.stdout)
    assert list((home.parent / "tmp").iterdir()) == []


def private_name(printed: str) -> bool:
    return Path(printed.strip()).name.startswith("echolocate-kernels-")


def test_a_home_without_xdg_is_dot_cache(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(home))
    assert kernels.cache_folder().is_relative_to(home / ".cache" / "echolocate" / "kernels")


def test_an_existing_setting_is_respected(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", "/somewhere/else")
    assert kernels.use_kernel_cache() == Path("/somewhere/else")
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    assert kernels.use_kernel_cache() == kernels.cache_folder()
    assert os.environ["NUMBA_CACHE_DIR"] == str(kernels.cache_folder())
    assert home.exists()


def test_a_run_compiles_only_the_parts_that_it_needs() -> None:
    hallway = load_settings("hallway")
    assert kernels.needed_parts(hallway) == (kernels.EMULATOR, kernels.BAYES)
    boxes = load_settings("hallway", models=["semicircle", "box"])
    assert kernels.needed_parts(boxes) == (kernels.EMULATOR, kernels.BAYES, kernels.POLYGONS)
    paper = load_settings("hallway", ["perception.method=paper"], models=["box"])
    assert kernels.needed_parts(paper) == (kernels.EMULATOR, kernels.PAPER)
    corrected = load_settings("hallway", ["perception.localization.correct_drift=true"])
    assert kernels.needed_parts(corrected) == (kernels.EMULATOR, kernels.BAYES, kernels.LOCALIZATION)
    mapped = with_known_room(load_settings("hallway"), "irregular")
    assert kernels.needed_parts(mapped) == (kernels.EMULATOR, kernels.BAYES, kernels.KNOWN_ROOM)
    with_grid = load_settings("hallway", ["perception.grid.method=directed"])
    assert kernels.needed_parts(with_grid) == (kernels.EMULATOR, kernels.BAYES, "directed")
    assert set(warming.RUN_ONCE) == set(kernels.PARTS)


def test_each_part_is_compiled_once_and_then_warmed_up(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(home))
    monkeypatch.delenv("NUMBA_DISABLE_JIT", raising=False)
    home.mkdir()
    happened: list[str] = []

    def compile_parts(_settings: Settings, folder: Path, parts: Sequence[str]) -> None:
        for part in parts:
            (folder / part).touch()
            happened.append(f"compile {part}")

    monkeypatch.setattr(kernels, "compile_parts", compile_parts)
    monkeypatch.setattr(kernels, "warm_up", lambda _settings, parts: happened.extend(parts))
    settings, console = load_settings("hallway"), Console(quiet=True)
    kernels.prepare_kernels(settings, console)
    assert happened == ["compile emulator", "compile bayes"]
    happened.clear()
    kernels.prepare_kernels(settings, console)
    assert happened == ["bayes"], "the emulator is another process"
    happened.clear()
    kernels.prepare_kernels(load_settings("hallway", models=["box"]), console)
    assert happened == ["compile polygons", "bayes"]
    (home / kernels.BAYES).unlink()
    assert kernels.uncompiled_parts(home, kernels.PARTS) == [
        kernels.BAYES, kernels.PAPER, kernels.LOCALIZATION, kernels.KNOWN_ROOM, *kernels.GRIDS,
    ]  # fmt: skip
    happened.clear()
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    kernels.prepare_kernels(settings, console)
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

    monkeypatch.setattr(warming, "compile_in_parallel", compile_in_parallel)
    monkeypatch.setattr(warming, "observe_only", noted("observe_only"))
    monkeypatch.setattr(warming, "RUN_ONCE", {part: noted(part) for part in kernels.PARTS})
    monkeypatch.setattr(os, "cpu_count", lambda: processors)
    kernels.compile_parts(load_settings("hallway"), tmp_path, parts)
    assert happened == [*helped, *(["waited"] if helped else []), *parts]
    assert {path.name for path in tmp_path.iterdir()} == set(parts)


COMPILED_LATER = """
import sys
from runtime.support.kernel_cache import needed_parts, prepare_kernels, use_kernel_cache
use_kernel_cache()
from config.load import load_settings
from rich.console import Console
settings = load_settings("hallway", sys.argv[1].split(), models=sys.argv[2].split())
prepare_kernels(settings, Console(quiet=True))
from numba.core import event
late = []
class Listener(event.Listener):
    def on_start(self, e): late.append(str(e.data["dispatcher"].py_func.__name__))
    def on_end(self, e): pass
from config.load import load_model
from perception.edits import (
    ClearMap, ConfirmObject, DeleteSegments, MoveObject, PinSegments, PlaceModel, RemoveObject,
)
from runtime.console.frames.frame_encoder import FrameContext, FrameEncoder
from runtime.cycle.inputs import Request
from runtime.cycle.modes import Mode
from runtime.simulation.closed_loop import OperatorInput, simulate

further = settings.model_copy(update={"models": (*settings.models, load_model(sys.argv[3]))})
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

with event.install_listener("numba:compile", Listener()):
    run = simulate(
        settings, settings.world, 0, 15.0, operator=by_hand, reload=lambda n: further if n == 100 else None,
    )
assert run.state.cycle > 280 and run.state.odometry.pose.x > 1.0, run.state
sys.exit(" ".join(late))
"""


@pytest.mark.compiled
@pytest.mark.usefixtures("warm_kernels")
@pytest.mark.parametrize(
    ("sets", "models", "further"),
    [
        ("perception.method=bayes", "semicircle", "keg.toml"),
        ("perception.method=bayes", "semicircle box", "hexagon.toml"),
        ("perception.localization.correct_drift=true", "semicircle", "keg.toml"),
        ("perception.method=paper", "semicircle", "box"),
    ],
)
def test_nothing_of_perception_is_compiled_while_the_robot_drives_and_a_person_edits(
    tmp_path: Path, sets: str, models: str, further: str
) -> None:
    """The emulator's kernels may still load: it is another process when it matters."""
    hexagon = [[math.cos(a), math.sin(a)] for a in (k * math.pi / 3.0 for k in range(6))]
    (tmp_path / "hexagon.toml").write_text(f'name = "hexagon"\nclosed = true\nvertices_m = {hexagon}\n')
    (tmp_path / "keg.toml").write_text(f'name = "keg"\nclosed = true\narc_radius_m = 1.0\nvertices_m = {hexagon}\n')
    further = str(tmp_path / further) if "." in further else further
    done = subprocess.run(
        [sys.executable, "-c", COMPILED_LATER, sets, models, further],
        cwd=ROOT, text=True, capture_output=True, check=False,
    )  # fmt: skip
    sources = "".join(path.read_text("utf-8") for path in (ROOT / "perception").rglob("*.py"))
    assert "Traceback" not in done.stderr, done.stderr
    late = [name for name in done.stderr.split() if f"def {name}(" in sources]
    assert late == [], done.stderr


@pytest.mark.compiled
@pytest.mark.usefixtures("warm_kernels")
def test_a_kernel_that_comes_to_life_is_counted_once() -> None:
    """Kernels are imported from file to file; each signature counts once, and one more argument type is one more."""
    import numpy as np

    from perception import kernel as decorator
    from perception import relaxation

    before = kernels.compiled_signatures()
    assert before > 10

    def doubled(values: decorator.Floats) -> float:
        return 2.0 * float(values[0])

    relaxation.doubled = compiled = decorator.kernel(doubled)  # type: ignore[attr-defined]
    try:
        assert kernels.compiled_signatures() == before
        compiled(np.ones(1))
        assert kernels.compiled_signatures() == before + 1
        compiled(np.ones(1, dtype=np.float32))
        assert kernels.compiled_signatures() == before + 2
    finally:
        del relaxation.doubled  # type: ignore[attr-defined]


@pytest.mark.promise("P28")
def test_without_a_home_folder_the_cache_is_temporary(homeless: Path) -> None:
    assert kernels.cache_folder().parent == homeless / "tmp"
    assert [file.name for file in homeless.iterdir()] == ["tmp"], "no folder of the name ~"


def test_without_any_place_it_is_said(homeless: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(homeless / "nowhere"))
    with pytest.raises(UserError, match=r"neither in .* nor in a temporary folder: No such file"):
        kernels.cache_folder()
