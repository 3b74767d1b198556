"""Runs tests in a few processes, `pytest --forks 4`, all forked from one that has imported and collected them.

A process that starts anew and imports everything by itself, as those of pytest-xdist do, takes 15 s of processor time
before its first test, and loads every kernel again. Here one process does all that, then forks. Each child takes one
file of tests after another from a pipe, and sends its reports to the parent, which shows and counts them.

Some files wait most of the time, for the clock or a browser. They have a pipe of their own, with which every other
child begins: while those wait, the rest computes.
"""

from __future__ import annotations

import fcntl
import os
import shutil
import signal
import struct
import sys
import tempfile
import traceback
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import groupby
from multiprocessing.connection import Connection, Pipe, wait
from pathlib import Path
from typing import Any, Final

import pytest

NUMBER: Final = struct.Struct("=I")
DONE: Final = "done"
PROCESS: Final = "process"
"""Of the names of the processes' temporary folders."""


def files_of(items: Sequence[pytest.Item]) -> list[list[int]]:
    """Return the indices of the tests of each file."""
    return [list(group) for _, group in groupby(range(len(items)), lambda index: items[index].path)]


def shared_numbers(numbers: Iterable[int]) -> int:
    """Return the reading end of a pipe from which several processes take these numbers."""
    reading, writing = os.pipe()
    with os.fdopen(writing, "wb") as pipe:  # below 64 kB, so it need not be read meanwhile
        pipe.write(b"".join(map(NUMBER.pack, numbers)))
    return reading


def taken(*pipes: int) -> Iterator[int]:
    """Take numbers from such pipes, one after the other, until none is left."""
    for pipe in pipes:
        while data := os.read(pipe, NUMBER.size):
            yield NUMBER.unpack(data)[0]


def made_once(folders: pytest.TempPathFactory, name: str, make: Callable[[Path], None]) -> Path:
    """Return this process's own copy of a file, `name`/hall.mcap, which one process of a run makes for all.

    Parameters
    ----------
    folders : TempPathFactory
        Of this process.
    name : str
        Of the folder: unique among these files.
    make : callable
        Writes the file at a path.
    """
    own = folders.getbasetemp()
    shared = (own.parent if own.name.startswith(PROCESS) else own) / "made_once" / name
    shared.mkdir(parents=True, exist_ok=True)
    file = shared / "hall.mcap"
    with (shared / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not file.exists():
            draft = Path(tempfile.mkdtemp(dir=shared)) / file.name
            make(draft)
            draft.rename(file)
    return Path(shutil.copy2(file, folders.mktemp(name) / file.name))


class ForkedTests:
    """Plugin that runs what was collected.

    Parameters
    ----------
    processes : int
        Number of children.
    waits : callable
        Returns whether a test mostly waits.
    prepare : callable
        Loads in the parent what every child needs, and may leave tests out.
    finish : callable
        Is called with its number in each child, after its last test.
    """

    def __init__(
        self, processes: int, waits: Callable[[pytest.Item], bool],
        prepare: Callable[[pytest.Session], None], finish: Callable[[int], None],
    ) -> None:  # fmt: skip
        self._processes = processes
        self._waits = waits
        self._prepare = prepare
        self._finish = finish

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> bool | None:
        """Run all tests; every one is reported, or the session fails."""
        if session.testsfailed or session.config.option.collectonly:
            return None  # pytest's own loop runs nothing, and says why
        self._prepare(session)
        _temp_paths(session).getbasetemp()  # made once, before there are several who would
        files = files_of(session.items)
        waiting = {n for n, file in enumerate(files) if any(self._waits(session.items[index]) for index in file)}
        pipes = shared_numbers(sorted(waiting)), shared_numbers(n for n in range(len(files)) if n not in waiting)
        orders = pipes, pipes[::-1]
        children = dict(self._fork(session, files, orders[number % 2], number) for number in range(self._processes))
        for pipe in pipes:
            os.close(pipe)
        missing = set(range(len(session.items)))
        try:
            self._listen(session, children, missing)
        finally:
            for child in children.values():
                os.kill(child, signal.SIGKILL)
                os.waitpid(child, 0)
        if missing and not session.shouldfail:
            names = "\n".join(session.items[index].nodeid for index in sorted(missing))
            session.shouldfail = f"not run, because a process had ended:\n{names}"
        if session.shouldfail:
            raise session.Failed(session.shouldfail)
        return True

    def _fork(
        self, session: pytest.Session, files: list[list[int]], pipes: Sequence[int], number: int
    ) -> tuple[Connection[Any, Any], int]:
        """Start a child; return where its reports come from, and its ID."""
        receiver, sender = Pipe(duplex=False)
        sys.stdout.flush()
        sys.stderr.flush()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # numpy's threads, which are made for it
            child = os.fork()
        if child:
            sender.close()
            return receiver, child
        status = 1
        try:
            receiver.close()
            items = [[session.items[index] for index in file] for file in files]
            _Child(session, sender, number).run(items, files, taken(*pipes))
            self._finish(number)
            status = 0
        except BaseException:  # noqa: BLE001 - nothing of it may return into the parent's part
            traceback.print_exc()
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(status)

    def _listen(self, session: pytest.Session, children: dict[Connection[Any, Any], int], missing: set[int]) -> None:
        """Pass on what children send, until all have ended; then `missing` has the tests that were not run."""
        hook = session.config.hook
        under_way: dict[Connection[Any, Any], int] = {}
        while children:
            for receiver in wait(list(children)):
                assert isinstance(receiver, Connection)
                try:
                    index, data = receiver.recv()
                except EOFError:
                    status = os.waitstatus_to_exitcode(os.waitpid(children.pop(receiver), 0)[1])
                    if receiver in under_way:
                        missing.discard(under_way[receiver])
                        _report_lost(session, under_way.pop(receiver), status)
                    elif status:
                        session.shouldfail = session.shouldfail or f"a process ended with status {status}"
                    continue
                item = session.items[index]
                if data is None:
                    under_way[receiver] = index
                elif data != DONE:
                    if not session.shouldfail:  # else the others may have gone on to a failure of their own
                        hook.pytest_runtest_logreport(
                            report=hook.pytest_report_from_serializable(config=session.config, data=data)
                        )
                else:
                    missing.discard(under_way.pop(receiver))
                    hook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
                    if session.shouldfail:
                        raise session.Failed(session.shouldfail)
                    if session.shouldstop:
                        raise session.Interrupted(session.shouldstop)


def _report_lost(session: pytest.Session, index: int, status: int) -> None:
    """Report a test as failed during which its process ended."""
    item = session.items[index]
    why = f"the process that ran it ended with status {status}"
    report = pytest.TestReport(item.nodeid, item.location, {}, "failed", why, "call")
    session.config.hook.pytest_runtest_logreport(report=report)


def _temp_paths(session: pytest.Session) -> Any:
    return session.config._tmp_path_factory  # type: ignore[attr-defined]


class _Child:
    """Runs tests in a child, and sends what happens as (index of the test, report); None is its begin."""

    def __init__(self, session: pytest.Session, sender: Connection[Any, Any], number: int) -> None:
        self._session = session
        self._sender = sender
        self._index = 0
        config = session.config
        for name in ("terminalreporter", "junitxml", "lfplugin"):  # reports are shown and kept by the parent
            if config.pluginmanager.hasplugin(name):
                config.pluginmanager.unregister(name=name)
        config.pluginmanager.register(self, "child")
        # What children capture must not go into one file, nor their temporary folders into one.
        capture: Any = config.pluginmanager.getplugin("capturemanager")
        capture.stop_global_capturing()
        capture.start_global_capturing()
        capture.suspend_global_capture(in_=False)
        factory = _temp_paths(session)
        own = factory.getbasetemp() / f"{PROCESS}{number}"
        own.mkdir()
        factory._basetemp = own

    def run(self, files: list[list[pytest.Item]], indices: list[list[int]], numbers: Iterator[int]) -> None:
        """Run the tests of the files whose numbers come."""
        queue = ((i, item) for n in numbers for i, item in zip(indices[n], files[n], strict=True))
        now = next(queue, None)
        while now is not None:
            self._index, item = now
            self._sender.send((self._index, None))
            # The next is known before this one ends, which ends what the next does not need.
            now = next(queue, None)
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=None if now is None else now[1])
            self._sender.send((self._index, DONE))

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Send a report to the parent, but that of a passed setup or teardown of which nothing is shown."""
        config = self._session.config
        is_timed = config.option.durations is not None or getattr(config.option, "xmlpath", None) is not None
        if report.passed and report.when != "call" and not is_timed and not report.sections:
            return
        self._sender.send((self._index, config.hook.pytest_report_to_serializable(config=config, report=report)))
