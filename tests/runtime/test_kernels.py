"""The kernels' cache: a folder for each version of the sources, wherever one can be written."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from importlib.machinery import ModuleSpec
from pathlib import Path

import pytest
from rich.console import Console

import runtime.kernels as kernels
from config.load import load_settings
from config.settings import Settings

ROOT = Path(__file__).parents[2]


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache of its own, and a machine's folder for temporary files of its own."""
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


def test_it_is_the_same_folder_for_the_same_sources(home: Path) -> None:
    folder = kernels.cache_folder()
    assert folder == kernels.cache_folder()
    assert folder.is_dir()
    assert folder.is_relative_to(home / "echolocate" / "kernels")
    assert list(folder.iterdir()) == []


def test_one_byte_of_one_source_makes_another_folder(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
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


def test_kernels_with_checked_bounds_are_kept_apart(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Numba's own key does not hold this setting: it would load kernels without checks."""
    monkeypatch.delenv("NUMBA_BOUNDSCHECK", raising=False)
    plain = kernels.cache_folder()
    monkeypatch.setenv("NUMBA_BOUNDSCHECK", "1")
    assert kernels.cache_folder() != plain
    assert plain.is_relative_to(home)


def test_every_source_with_kernels_counts() -> None:
    holders = {
        path.parent
        for room in ("perception", "drivers", "behaviors", "runtime")
        for path in (ROOT / room).rglob("*.py")
        if "@kernel" in path.read_text("utf-8") or "njit" in path.read_text("utf-8")
    }
    assert holders == {ROOT.joinpath(*name.split(".")) for name in kernels.PACKAGES}


def test_an_unwritable_home_falls_back(home: Path) -> None:
    home.write_text("a file is no folder, not even for root")
    folder = kernels.cache_folder()
    assert folder.is_relative_to(home.parent / "tmp" / f"echolocate-{os.getuid()}")
    assert folder.is_dir()
    (home.parent / "tmp").rename(home.parent / "gone")
    (home.parent / "tmp").mkdir()
    (home.parent / "tmp" / f"echolocate-{os.getuid()}").write_text("taken by somebody else")
    last = kernels.cache_folder()
    assert last.is_dir()
    assert last.parent == home.parent / "tmp"


def test_a_home_without_xdg_is_dot_cache(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(home))
    assert kernels.cache_folder().is_relative_to(home / ".cache" / "echolocate" / "kernels")


def test_an_existing_setting_is_respected(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", "/somewhere/else")
    assert kernels.use_cache() == Path("/somewhere/else")
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    assert kernels.use_cache() == kernels.cache_folder()
    assert os.environ["NUMBA_CACHE_DIR"] == str(kernels.cache_folder())
    assert home.exists()


def test_warmth_is_noted_once_everything_was_compiled(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(home))
    monkeypatch.delenv("NUMBA_DISABLE_JIT", raising=False)
    home.mkdir()
    compiled = []

    def compile_all(_settings: Settings, folder: Path) -> None:
        compiled.append(folder)
        (folder / kernels.WARM).touch()

    monkeypatch.setattr(kernels, "compile_all", compile_all)
    monkeypatch.setattr(kernels, "warm_up", lambda _settings: compiled.append(Path("warmed up")))
    settings, console = load_settings("hallway"), Console(quiet=True)
    assert not kernels.is_warm(home)
    kernels.ready_kernels(settings, console)
    assert kernels.is_warm(home)
    kernels.ready_kernels(settings, console)
    assert compiled == [home, Path("warmed up")]
    (home / kernels.WARM).unlink()
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    assert kernels.is_warm(home), "there is nothing to compile"


COMPILED_LATER = """
import sys
from runtime.kernels import ready_kernels, use_cache
use_cache()
from config.load import load_settings
from rich.console import Console
settings = load_settings("hallway")
ready_kernels(settings, Console(quiet=True))
from numba.core import event
late = []
class Listener(event.Listener):
    def on_start(self, e): late.append(str(e.data["dispatcher"].py_func.__name__))
    def on_end(self, e): pass
with event.install_listener("numba:compile", Listener()):
    from runtime.simulate import simulate
    simulate(settings, settings.world, 0, 12.0)
sys.exit(" ".join(late))
"""


@pytest.mark.realtime
@pytest.mark.usefixtures("warm_kernels")
def test_nothing_of_perception_is_compiled_while_the_robot_drives() -> None:
    """The emulator's kernels may still load: it is another process when it matters."""
    done = subprocess.run(
        [sys.executable, "-c", COMPILED_LATER], cwd=ROOT, text=True, capture_output=True, timeout=120, check=False
    )
    sources = "".join(path.read_text("utf-8") for path in (ROOT / "perception").rglob("*.py"))
    late = [name for name in done.stderr.split() if f"def {name}(" in sources]
    assert late == [], done.stderr


@pytest.mark.realtime
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

    relaxation.doubled = compiled = decorator.numba.njit(doubled)  # type: ignore[attr-defined]
    try:
        assert kernels.compiled_signatures() == before
        compiled(np.ones(1))
        assert kernels.compiled_signatures() == before + 1
        compiled(np.ones(1, dtype=np.float32))
        assert kernels.compiled_signatures() == before + 2
    finally:
        del relaxation.doubled  # type: ignore[attr-defined]
