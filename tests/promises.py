"""The promises this program makes, and the machinery that ties each to the tests that carry it.

A test carries a promise by `@pytest.mark.promise("P4")` and tells what it measured by the fixture `measured`. The
hooks in `conftest.py` call in here: an unknown ID ends every run before it begins, an ID that no test carries ends a
run of the whole suite, and `--promises=PAGE` writes the page of what was promised and what was measured. A run of
some tests only renews their rows and leaves the others as they are; each row has its own date.

To add a promise, add its entry to `PROMISES` and mark a test with its ID.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "promises.md"
"""What `make promises` writes."""
SOAK_PAGE = ROOT / "docs" / "promises-soak.md"
"""What `make soak` writes."""
MEASURED, CARRIES = "measured", "promise"
"""Names of the properties that a test's report carries."""


class Promise(NamedTuple):
    """What is promised, and by which figure it is kept."""

    text: str
    figure: str


PROMISES: Mapping[str, Promise] = MappingProxyType(
    {
        "P1": Promise(
            "The base stops by itself",
            "SIGSTOP, SIGKILL, unplug, 10 s busy loop in a callback, at 20 random phases (soak: 200): wheels still "
            "within deadman + 300 ms on the emulator's clock; motion resumes only after an explicit re-arm",
        ),
        "P2": Promise(
            "Halt is bounded",
            "request → HALT on the wire ≤ one cycle + 10 ms with perception saturated, the disk stalled, a reconnect "
            "under way; 1,000 trials in virtual time, 30 in real time (soak: 1,000); one frame stops the whole base",
        ),
        "P3": Promise(
            "No bad command leaves",
            "10⁶ random schema outputs with NaN, ±Inf, 1e308: not one non-finite or over-limit DRIVE; a missing axis "
            "is Stop(reason)",
        ),
        "P4": Promise(
            "The decoder is total",
            "10⁷ fuzzed bytes (soak: 10⁹): no exception, buffer ≤ 1 KiB, in step again after two good frames, any "
            "chunking equals the whole; false accepts counted against what CRC-16 predicts",
        ),
        "P5": Promise(
            "Unplug anywhere",
            "the line cut before every byte of handshake and one full pattern, both directions: echoes again ≤ 1 s "
            "after replug; 1,000 cycles with flat file descriptors, tasks and memory",
        ),
        "P6": Promise(
            "A stalled peer is harmless",
            "mute, or not reading, for 5 s (soak: 60 s): the loop's worst gap ≤ paired control + 5 ms, unsent bytes "
            "≤ 4 KiB, newest command wins, link called dead ≤ 500 ms",
        ),
        "P7": Promise(
            "A robot reboot is seen",
            "new boot_id mid-run: pattern sent again, clock and odometry re-based without a jump in the map, "
            "SAFE_STOP until re-armed",
        ),
        "P8": Promise(
            "Crosstalk, ghosts and stuck sensors are caught",
            "pattern changes expose crosstalk; a sensor that never changes or always fails is masked and reported; "
            "late, duplicate and out-of-window echoes never reach perception; no honest sensor masked",
        ),
        "P9": Promise(
            "The map forgets lies",
            "20 % outliers, a garbage burst, a 1 ft odometry jump: seen from the robot, objects are back within "
            ".05 ft of truth within 20 readings; no ghost of the old frame and no false object survives 10 s",
        ),
        "P10": Promise(
            "No silent death",
            "any task or thread killed or raising: SAFE_STOP within two cycles, the culprit named; the deadman is "
            "fed only while all parts report health; never from a thread",
        ),
        "P11": Promise(
            "Configuration cannot half-apply",
            "every field × {missing, wrong type, low, high, typo}: message with path, value, range, nearest name; "
            "10⁴ random live reloads are atomic, the last good one kept; restart-only fields say so",
        ),
        "P12": Promise(
            "Disk trouble stays on disk",
            "full disk, 5 s fsync, read-only folder, a log or terminal that takes nothing: no cycle is late beyond "
            "the paired control, the loss is counted and reported",
        ),
        "P13": Promise(
            "One owner",
            "a second process on the same port or the same record file is refused with a clear line; a stale lock is "
            "recognised",
        ),
        "P14": Promise(
            "Input files cannot hurt",
            "10⁵ mutated ring logs, worlds, models, robot files (here a share of them, in `make soak` all): clear "
            "error or right result, no traceback, no hang, memory ≤ 500 MB",
        ),
        "P15": Promise(
            "It runs on",
            "half an hour in virtual time (soak: 24 h, and 1 h on the pty): memory slope < 1 MB/h, no unretrieved "
            "task exception, t_us wrap crossed",
        ),
        "P16": Promise("Traceable", "this table is generated from the tests that ran"),
    }
)  # fmt: skip


@dataclass(frozen=True)
class Carrier:
    """One test function that carries promises; parameters of one function are one carrier.

    A long form may carry none: it is listed all the same, for what it measured.
    """

    test: str
    ids: tuple[str, ...]
    soak: bool


@dataclass
class Ledger:
    """Who carries what in this run, and what was measured.

    Attributes
    ----------
    carriers
        Of everything collected, before any of it was deselected.
    whole
        True where the whole suite was collected.
    """

    carriers: tuple[Carrier, ...] = ()
    whole: bool = False
    results: dict[str, list[str]] = field(default_factory=dict)
    failed: set[str] = field(default_factory=set)

    def take_report(self, report: pytest.TestReport) -> None:
        """Enter what one phase of one test tells."""
        properties = [(key, str(value)) for key, value in report.user_properties]
        if not any(key == CARRIES for key, _ in properties):
            return
        test = report.nodeid.split("[")[0]
        if report.failed:
            self.failed.add(test)
        elif report.when == "call" and report.passed:
            told = self.results.setdefault(test, [])
            told += [value for key, value in properties if key == MEASURED and value not in told]


LEDGER = pytest.StashKey[Ledger]()


def carriers_of(items: Iterable[pytest.Item]) -> tuple[Carrier, ...]:
    """Return who carries which promises, in the order of collection.

    Raises
    ------
    pytest.UsageError
        A marker names no ID, or one that is not in `PROMISES`.
    """
    found: dict[str, Carrier] = {}
    for item in items:
        ids = tuple(dict.fromkeys(one for mark in item.iter_markers(CARRIES) for one in mark.args))
        unknown = [one for one in ids if one not in PROMISES]
        if unknown or (not ids and item.get_closest_marker(CARRIES) is not None):
            named = ", ".join(map(repr, unknown)) or "no ID"
            raise pytest.UsageError(
                f"{item.nodeid}: @pytest.mark.promise names {named}; known are {', '.join(PROMISES)}: "
                f"correct the ID, or add it to tests/promises.py"
            )
        soak = item.get_closest_marker("soak") is not None
        if ids or soak:
            test = item.nodeid.split("[")[0]
            found[test] = Carrier(test, ids, soak and found.get(test, Carrier("", (), soak=True)).soak)
    return tuple(found.values())


def broken(carriers: Sequence[Carrier]) -> list[str]:
    """Return the IDs that no test of every run carries; a soak test alone is run too seldom."""
    kept = {one for carrier in carriers if not carrier.soak for one in carrier.ids}
    return [one for one in PROMISES if one not in kept]


def collect(config: pytest.Config, items: Sequence[pytest.Item]) -> None:
    """Open the ledger of a run whose tests have been collected and not yet selected among.

    Raises
    ------
    pytest.UsageError
        A test carries an unknown ID; or, where the whole suite was collected, an ID has no test.
    """
    whole = config.args_source is pytest.Config.ArgsSource.TESTPATHS
    ledger = Ledger(carriers_of(items), whole)
    config.stash[LEDGER] = ledger
    if whole and (without := broken(ledger.carriers)):
        raise pytest.UsageError(
            f"no test carries {', '.join(without)}: mark one with @pytest.mark.promise, or take the promise back in "
            f"tests/promises.py"
        )


NO_PROMISE = "–"
"""In place of an ID."""


class Row(NamedTuple):
    """A row of the page."""

    promise: str
    test: str
    measured: str
    day: str

    def __str__(self) -> str:
        return f"| {self.promise} | `{self.test}` | {self.measured} | {self.day} |"


_ROW = re.compile(r"\| (?P<promise>P\d+|–) \| `(?P<test>[^`]+)` \| (?P<measured>.*) \| (?P<day>[-\d]+) \|")


def _place(row: tuple[str, ...]) -> tuple[int, str]:
    """Return where a row that begins with ID and test belongs: whichever run wrote it, the page is the same."""
    return [*PROMISES, NO_PROMISE].index(row[0]), row[1]


def rows_of(carriers: Iterable[Carrier], *, soak: bool) -> list[tuple[str, str]]:
    """Return (ID, test) as the page lists them, by ID and then by the test's name."""
    mine = [carrier for carrier in carriers if carrier.soak == soak]
    return sorted(((one, c.test) for c in mine for one in c.ids or (NO_PROMISE,)), key=_place)


def rows_in(page: str) -> list[Row]:
    """Return the rows of a written page."""
    return [Row(**found.groupdict()) for found in map(_ROW.fullmatch, page.splitlines()) if found is not None]


def listed_in(page: str) -> list[tuple[str, str]]:
    """Return the (ID, test) that a written page lists."""
    return [(row.promise, row.test) for row in rows_in(page)]


def merged(ledger: Ledger, before: Iterable[Row], *, soak: bool, day: str) -> list[Row]:
    """Return the rows of the page: of what ran anew, and as it was of what did not.

    Raises
    ------
    ValueError
        A test that carries a promise failed; or, in a run of the whole suite, did not run to its end.
    """
    due = rows_of(ledger.carriers, soak=soak)
    tests = {test for _, test in due}
    if missing := sorted(tests & ledger.failed | (tests - ledger.results.keys() if ledger.whole else set())):
        raise ValueError(f"did not pass: {', '.join(missing)}")
    ran = {
        (one, test): Row(one, test, "<br>".join(ledger.results[test]) or "passed", day)
        for one, test in due
        if test in ledger.results
    }
    if ledger.whole:
        return list(ran.values())
    known = {(row.promise, row.test): row for row in before if row.promise in {*PROMISES, NO_PROMISE}} | ran
    return sorted(known.values(), key=_place)


def render(rows: Sequence[Row], *, soak: bool) -> str:
    """Return the page: what is promised, then which test measured what, and when."""
    command, other = ("make soak", "make promises") if soak else ("make promises", "make soak")
    lines = [
        "# What is promised, and what was measured",
        "",
        f"Written by `{command}` from the tests that ran; the {'short' if soak else 'long'} forms: `{other}`.",
        f"`pytest{' -m soak' if soak else ''} TEST --promises=PAGE` renews the rows of single tests.",
        "",
    ]
    kept = dict.fromkeys(row.promise for row in rows if row.promise in PROMISES)
    lines += [f"- **{one}: {PROMISES[one].text}.** {PROMISES[one].figure}." for one in kept]
    lines += ["", "| promise | test | measured | on |", "|---|---|---|---|"]
    return "\n".join([*lines, *map(str, rows)]) + "\n"
