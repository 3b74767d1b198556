"""Tests of the kernel cache: a folder of this user's, and in it the marks of each version of the sources."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType

import pytest

import runtime.support.kernel_cache as kernels
from config.errors import UserError
from config.load import load_settings, with_known_room
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
    """Put two packages in place of the real ones, read at each call; return a source of the second."""
    monkeypatch.setattr(kernels, "_key", kernels._key.__wrapped__)
    for name in kernels.PACKAGES:
        (folder / name).mkdir(parents=True)
        (folder / name / "a.py").write_text("X = 1\n")

    def find(name: str) -> ModuleSpec:
        spec = ModuleSpec(name, None, is_package=True)
        spec.submodule_search_locations = [str(folder / name)]
        return spec

    monkeypatch.setattr(kernels, "find_spec", find)
    return folder / kernels.PACKAGES[1] / "a.py"


def test_all_sources_share_a_folder_for_kernels_and_each_has_one_for_its_marks(
    home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    source = packages(home.parent / "sources", monkeypatch)
    marks = kernels.use_kernel_cache()
    assert kernels.cache_folder() == marks.parent == home / "echolocate" / "kernels"
    assert list(marks.iterdir()) == []
    source.write_text("X = 2\n")
    assert kernels.use_kernel_cache().parent == marks.parent
    assert kernels.use_kernel_cache() != marks


def test_a_changed_byte_of_a_source_changes_the_key(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source = packages(home.parent / "sources", monkeypatch)
    first = kernels.kernels_key()
    source.write_text("X = 2\n")
    second = kernels.kernels_key()
    assert first != second
    source.write_text("X = 1\n")
    assert kernels.kernels_key() == first
    source.with_name("b.py").write_text("")
    (source.parent / "notes.txt").write_text("no source")
    assert kernels.kernels_key() == first, "an empty file and a note change no kernel"
    source.with_name("b.py").write_text("Y = 3\n")
    assert kernels.kernels_key() not in {first, second}


@pytest.mark.parametrize("setting", ["NUMBA_BOUNDSCHECK", "NUMBA_OPT"])
def test_kernels_that_are_compiled_otherwise_have_marks_of_their_own(
    setting: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(setting, raising=False)
    plain = kernels.kernels_key()
    monkeypatch.setenv(setting, "1")
    assert kernels.kernels_key() != plain


def test_every_package_that_kernels_read_is_hashed() -> None:
    """Constants and records of what a kernel imports are compiled into it."""
    sources = {
        path.relative_to(ROOT).with_suffix("").as_posix().replace("/", "."): path.read_text("utf-8")
        for room in ("perception", "drivers", "behaviors", "runtime")
        for path in (ROOT / room).rglob("*.py")
    }
    holders = {name for name, source in sources.items() if "@kernel" in source or "njit" in source}
    read = {
        name
        for holder in holders
        for name in re.findall(r"^from (perception[\w.]*) import", sources[holder], re.MULTILINE)
    }
    assert {name.rpartition(".")[0] for name in holders | read} == set(kernels.PACKAGES)


def private(folder: Path, home: Path) -> bool:
    """Return whether this is a new, private folder outside the user's cache."""
    return folder.parent == home.parent / "tmp" and folder.stat().st_mode & 0o777 == 0o700


def test_an_unwritable_cache_is_replaced_by_a_new_private_folder(home: Path) -> None:
    home.write_text("a file is no folder, not even for root")
    folder = kernels.cache_folder()
    assert private(folder, home)
    assert kernels.cache_folder() != folder, "its name cannot be known beforehand"


@pytest.mark.promise("P17")
@pytest.mark.parametrize("depth", [0, 1])
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
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(home / "else"))
    assert kernels.use_kernel_cache().parent == home / "else"
    monkeypatch.setenv("NUMBA_CACHE_DIR", "")
    assert kernels.use_kernel_cache().parent == kernels.cache_folder()
    assert os.environ["NUMBA_CACHE_DIR"] == str(kernels.cache_folder())
    assert home.exists()


def test_a_run_compiles_only_the_parts_that_it_needs() -> None:
    hallway = load_settings("hallway")
    assert kernels.needed_parts(hallway) == (
        kernels.EMULATOR,
        kernels.RING,
        kernels.BAYES,
        kernels.VALLEY,
    )
    boxes = load_settings("hallway", models=["semicircle", "box"])
    assert kernels.needed_parts(boxes) == (
        kernels.EMULATOR,
        kernels.RING,
        kernels.BAYES,
        kernels.POLYGONS,
        kernels.VALLEY,
    )
    paper = load_settings("hallway", ["perception.method=paper"], models=["box"])
    assert kernels.needed_parts(paper) == (
        kernels.EMULATOR,
        kernels.RING,
        kernels.PAPER,
        kernels.VALLEY,
    )
    corrected = load_settings("hallway", ["perception.localization.correct_drift=true"])
    assert kernels.needed_parts(corrected) == (
        kernels.EMULATOR,
        kernels.RING,
        kernels.BAYES,
        kernels.LOCALIZATION,
        kernels.VALLEY,
        kernels.ECHO_LAG,
    )
    mapped = with_known_room(load_settings("hallway"), "irregular")
    assert kernels.needed_parts(mapped) == (
        kernels.EMULATOR,
        kernels.RING,
        kernels.BAYES,
        kernels.KNOWN_ROOM,
        kernels.VALLEY,
    )
    with_grid = load_settings("hallway", ["perception.grid.method=directed"])
    assert kernels.needed_parts(with_grid) == (
        kernels.EMULATOR,
        kernels.RING,
        kernels.BAYES,
        kernels.VALLEY,
        "directed",
    )
    assert set(warming.RUN_ONCE) == set(kernels.PARTS)


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


def test_signatures_are_counted_while_another_thread_imports_a_module(monkeypatch: pytest.MonkeyPatch) -> None:
    module = ModuleType(f"{kernels.PACKAGES[0]}.half_imported")

    class Growing:
        """Adds a name to the module as it is looked at, as the import does meanwhile."""

        @property  # type: ignore[misc]
        def __class__(self) -> type:
            setattr(module, f"name{len(vars(module))}", 0)
            return object

    module.first = Growing()  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, module.__name__, module)
    dispatchers = ModuleType("numba.core.dispatcher")
    dispatchers.Dispatcher = type("Dispatcher", (), {"overloads": ()})  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, dispatchers.__name__, dispatchers)
    assert kernels.compiled_signatures() == 0
    assert len(vars(module)) > 1
