"""Tests of the kernel loader: kernels are loaded before a change is in force, and outside the loop."""

from __future__ import annotations

import asyncio
import os
import subprocess
import sys
import threading
from collections.abc import Sequence
from pathlib import Path

import pytest
import structlog
from numba.core import event
from structlog.testing import LogCapture

from config.errors import UserError
from config.load import load_model, load_settings
from config.settings import Settings
from runtime.support import kernel_cache as kernels
from runtime.support import kernel_loader
from runtime.support.kernel_cache import BAYES, EMULATOR, POLYGONS, RING, needed_parts
from runtime.support.kernel_loader import KernelLoader, KernelPreparation, progress_text
from tests.hil.machine import TIMEOUT_S
from tests.hil.running import ROOT

ROUND = load_settings("hallway")
KEG = load_model("drum").model_copy(update={"name": "keg"})
DRUMS = ROUND.model_copy(update={"models": (*ROUND.models, KEG)})
BOXES = load_settings("hallway", models=["semicircle", "box"])


class Kernels:
    """Stub of compiling and loading kernels, which take too long for tests."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
        self.preparation = KernelPreparation(())
        self.preparation.is_over.set()
        self.fails = False
        self.compiled: list[str] = []
        self.loaded: list[tuple[str, ...]] = []
        self.threads: set[int] = set()
        self.log = LogCapture()
        monkeypatch.delenv("NUMBA_DISABLE_JIT", raising=False)
        monkeypatch.setenv("NUMBA_CACHE_DIR", str(folder))
        self.folder = kernels.use_kernel_cache()
        monkeypatch.setattr(kernel_loader, "warm_up", self._load)
        monkeypatch.setattr(kernel_loader, "compiled_signatures", lambda: 7 * len(self.loaded))
        log = structlog.wrap_logger(None, processors=[self.log])
        self.ready = KernelLoader(log, self._compile, self.preparation)

    async def _compile(self, part: str) -> None:
        await asyncio.sleep(0.0)
        self.compiled.append(part)
        if not self.fails:
            (self.folder / part).touch()

    def _load(self, settings: Settings, parts: Sequence[str]) -> None:
        assert settings is BOXES
        self.threads.add(threading.get_ident())
        self.loaded.append(tuple(parts))


@pytest.fixture
def kernels_stub(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Kernels:
    return Kernels(monkeypatch, tmp_path)


async def test_missing_kernels_are_compiled_once_and_loaded_by_a_thread(kernels_stub: Kernels) -> None:
    assert set(await asyncio.gather(kernels_stub.ready(ROUND, BOXES), kernels_stub.ready(ROUND, BOXES))) == {None}
    assert kernels_stub.compiled == [POLYGONS]
    assert kernels_stub.loaded == [(POLYGONS,), (POLYGONS,)], "each caller loads them: it costs little"
    assert threading.get_ident() not in kernels_stub.threads
    assert kernels_stub.ready.loaded == 14
    assert [entry["event"] for entry in kernels_stub.log.entries] == [
        "compiling the kernels for polygons, once; the change takes effect afterwards"
    ]


async def test_what_a_preparation_loads_is_waited_for(kernels_stub: Kernels) -> None:
    kernels_stub.preparation.is_over.clear()
    loading = asyncio.create_task(kernels_stub.ready(ROUND, BOXES))
    for _ in range(9):
        await asyncio.sleep(0)
    assert kernels_stub.compiled == []
    kernels_stub.preparation.is_over.set()
    assert await loading is None
    assert kernels_stub.compiled == [POLYGONS]


async def test_kernels_in_use_are_not_loaded_again(kernels_stub: Kernels, monkeypatch: pytest.MonkeyPatch) -> None:
    for running, proposed in ((ROUND, ROUND), (ROUND, DRUMS), (BOXES, BOXES), (BOXES, ROUND)):
        assert await kernels_stub.ready(running, proposed) is None
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    assert await kernels_stub.ready(ROUND, BOXES) is None
    assert (kernels_stub.compiled, kernels_stub.loaded, kernels_stub.ready.loaded) == ([], [], 0)


async def test_a_failed_compilation_is_refused_with_a_remedy(kernels_stub: Kernels) -> None:
    kernels_stub.fails = True
    refusal = await kernels_stub.ready(ROUND, BOXES)
    assert refusal is not None
    assert "start with such a model" in refusal
    assert kernels_stub.loaded == []


STANDS = "import pathlib, sys, time; pathlib.Path(sys.argv[1]).touch(); time.sleep(600)"


async def test_a_run_that_ends_does_not_wait_for_a_compiler(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    started_file, processes = tmp_path / "started", list[asyncio.subprocess.Process]()
    spawn = asyncio.create_subprocess_exec

    async def slow(*_command: str, **options: object) -> asyncio.subprocess.Process:
        processes.append(await spawn(sys.executable, "-c", STANDS, str(started_file), **options))  # type: ignore[arg-type]
        return processes[0]

    monkeypatch.delenv("NUMBA_DISABLE_JIT", raising=False)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(asyncio, "create_subprocess_exec", slow)
    ready = asyncio.create_task(_ready(structlog.wrap_logger(None, processors=[LogCapture()])))
    async with asyncio.timeout(TIMEOUT_S):
        while not (processes and started_file.exists()):  # the process may run before its start has returned
            await asyncio.sleep(0.01)
    ready.cancel()
    with pytest.raises(asyncio.CancelledError):
        await ready
    assert processes[0].returncode is not None, "it would outlive the run"


async def _ready(log: structlog.typing.FilteringBoundLogger) -> None:
    await KernelLoader(log)(ROUND, BOXES)


class Compiler:
    """Stands for the process that compiles: leaves index files and marks of parts, or ends without."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, folder: Path, parts: Sequence[str]) -> None:
        self.errors = b""
        self.returncode = 0
        self.words: Sequence[str] = ()
        self.killed: list[Compiler] = []
        self._parts = parts
        monkeypatch.delenv("NUMBA_DISABLE_JIT", raising=False)
        monkeypatch.setenv("NUMBA_CACHE_DIR", str(folder))
        self._folder = kernels.use_kernel_cache()
        monkeypatch.setattr(kernel_loader, "start_child", self._start)
        monkeypatch.setattr(kernel_loader, "kill_child", self._kill)
        monkeypatch.setattr(kernel_loader, "warm_up", lambda _settings, parts: self.loaded.append(tuple(parts)))
        self.loaded: list[tuple[str, ...]] = []

    async def _start(self, module: str, words: Sequence[str], *, pipes: bool, low_priority: bool) -> Compiler:
        assert (module, pipes, low_priority) == ("runtime.support.kernel_warmup", False, True)
        self.words = words
        return self

    async def communicate(self) -> tuple[None, bytes]:
        await asyncio.sleep(0.01)
        for part in self._parts:
            (self._folder / part).touch()
        return None, self.errors

    async def _kill(self, process: Compiler) -> None:
        self.killed.append(process)


def test_a_preparation_is_needed_wherever_there_is_a_compiler(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Also where all is compiled: loading takes longer than a robot should wait."""
    Compiler(monkeypatch, tmp_path, ())
    assert isinstance(kernel_loader.begin_preparation(ROUND), KernelPreparation)
    for part in needed_parts(ROUND):
        (kernels.use_kernel_cache() / part).touch()
    assert isinstance(kernel_loader.begin_preparation(ROUND), KernelPreparation)
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    assert kernel_loader.begin_preparation(BOXES) is None


async def test_a_preparation_compiles_in_another_process_and_loads_the_rest(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    compiler = Compiler(monkeypatch, tmp_path, (BAYES,))
    preparation = KernelPreparation((EMULATOR, RING, BAYES))
    assert preparation.progress == kernel_loader.RING_WAIT
    await preparation(ROUND)
    assert compiler.words == ["bayes,emulator", "whole"], "what the robot waits for comes first"
    assert compiler.loaded == [(BAYES,)], "the emulator is another process"
    assert preparation.progress.endswith("its kernels are being loaded, part 1 of 1")
    await preparation.close()
    assert compiler.killed == [compiler]


async def test_where_all_is_compiled_no_process_is_started(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    compiler = Compiler(monkeypatch, tmp_path, ())
    for part in (EMULATOR, BAYES):
        (kernels.use_kernel_cache() / part).touch()
    preparation = KernelPreparation((EMULATOR, BAYES))
    await preparation(ROUND)
    await preparation.close()
    assert (compiler.words, compiler.loaded, compiler.killed) == ((), [(BAYES,)], [])


async def test_what_the_first_cycle_needs_is_compiled_in_a_thread_of_this_process(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    Compiler(monkeypatch, tmp_path, ())
    happened: list[object] = []
    monkeypatch.setattr(
        kernel_loader, "compile_parts",
        lambda *call: happened.append((*call, threading.current_thread() is threading.main_thread())),
    )  # fmt: skip
    preparation = KernelPreparation((EMULATOR, RING, BAYES))
    assert preparation.first_start is not None, "it says that it takes some seconds"
    await preparation.ring(ROUND)
    folder = kernels.use_kernel_cache()
    assert happened == [(ROUND, folder, [RING], False)]
    (folder / RING).touch()
    assert KernelPreparation((EMULATOR, RING, BAYES)).first_start is None


async def test_the_rings_kernels_are_counted_and_the_end_of_the_run_ends_them(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    Compiler(monkeypatch, tmp_path, ())
    preparation = KernelPreparation((EMULATOR, RING, BAYES))
    said, done = list[str](), threading.Event()

    def compile_three(*_: object) -> None:
        for number in range(3):
            if number == 2:  # the run ends meanwhile
                asyncio.run_coroutine_threadsafe(preparation.close(), loop).result(5.0)
            with event.trigger_event("numba:compile", {}):
                said.append(preparation.progress)
        done.set()

    loop = asyncio.get_running_loop()
    monkeypatch.setattr(kernel_loader, "compile_parts", compile_three)
    await preparation.begin_ring(ROUND)
    assert [text.partition(": ")[2].partition(" of ")[0] for text in said] == ["0", "1"]
    assert not done.is_set()


async def test_a_preparation_without_a_result_says_why(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    compiler = Compiler(monkeypatch, tmp_path, ())
    compiler.errors = b"Traceback\nOSError: [Errno 28] No space left on device\n"
    with pytest.raises(UserError, match=r"\(OSError: \[Errno 28\] No space .*memory or disk space; make room"):
        await KernelPreparation((EMULATOR, BAYES))(ROUND)


async def test_a_compiler_that_the_system_ended_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """As for lack of memory."""
    compiler = Compiler(monkeypatch, tmp_path, ())
    compiler.returncode = -9
    with pytest.raises(
        UserError, match=r"\(the process that compiled them was ended by SIGKILL\), likely for lack of"
    ):
        await KernelPreparation((EMULATOR, BAYES))(ROUND)


def test_every_part_that_a_run_may_need_has_its_count_of_kernels() -> None:
    assert kernel_loader.KERNEL_COUNTS.keys() == {*kernels.PARTS} - {EMULATOR}
    assert all(kernel_loader.KERNEL_COUNTS.values())


def test_progress_counts_kernels_and_shows_the_time_left() -> None:
    text = "recognition is being prepared: {} of 100 kernels"
    assert progress_text(0, 100, 3.0) == f"{text.format(0)}, 3 s so far"
    assert progress_text(20, 100, 10.0) == f"{text.format(20)}, about 40 s left"
    assert progress_text(100, 100, 30.0) == f"{text.format(100)}, 30 s so far"


@pytest.mark.soak
def test_another_process_compiles_all_that_belongs_to_polygons(tmp_path: Path) -> None:
    """From an empty cache; the process that loads the part afterwards compiles nothing."""
    env = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    env |= {"PYTHONPATH": str(ROOT), "NUMBA_CACHE_DIR": str(tmp_path)}

    def run(*words: str) -> str:
        command = [sys.executable, *words]
        done = subprocess.run(command, env=env, capture_output=True, text=True, timeout=590, check=False)
        assert done.returncode == 0, done.stderr
        return done.stdout

    run("-m", "runtime.support.kernel_warmup", POLYGONS, "whole")
    assert kernels.uncompiled_parts(tmp_path / kernels.kernels_key(), [POLYGONS]) == []
    assert run("-c", LOADS) == "[]\n"


LOADS = """
from numba.core import event
compiled = []
class Listener(event.Listener):
    def on_start(self, e): compiled.append(str(e.data["dispatcher"].py_func.__name__))
    def on_end(self, e): pass
from config.load import load_settings
from runtime.support.kernel_cache import BAYES, POLYGONS, use_kernel_cache
from runtime.support.kernel_warmup import warm_up
use_kernel_cache()
warm_up(load_settings("hallway"), [BAYES])
with event.install_listener("numba:compile", Listener()):
    warm_up(load_settings("hallway", models=["semicircle", "box"]), [POLYGONS])
print(compiled)
"""
