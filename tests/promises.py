"""The promises this program makes, and the tests that verify them.

A test names its promises by `@pytest.mark.promise("P4")` and reports measurements by the fixture `measured`. Hooks in
`conftest.py` use this module: an unknown ID stops every run at collection, an ID without a test stops a run of the
whole suite, and `--promises=PAGE` writes `tests.promise_page`.

To add a promise, add its entry to `PROMISES` and mark a test with its ID.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "promises.md"
"""Page written by `make promises`."""
SOAK_PAGE = ROOT / "docs" / "promises-soak.md"
"""Page written by `make soak`."""
MEASURED, PROMISE = "measured", "promise"
"""Names of properties in a test's report."""


class Promise(NamedTuple):
    """A promise, and the figures that it is measured by."""

    text: str
    figure: str


PROMISES: Mapping[str, Promise] = MappingProxyType(
    {
        "P1": Promise(
            "The base stops by itself",
            "SIGSTOP, SIGKILL, busy loop in a callback, once each (soak: and unplug, 200 at random phases): wheels "
            "still within deadman + 300 ms on the emulator's clock; motion resumes only after an explicit re-arm",
        ),
        "P2": Promise(
            "Halt is bounded",
            "request → HALT on the wire ≤ one cycle + 10 ms with perception saturated, the disk stalled, a reconnect "
            "under way; 200 trials in virtual time (bench: 30 in real time, soak: 1,000); one frame stops the base",
        ),
        "P3": Promise(
            "No bad command leaves",
            "40,000 random schema outputs (soak: 10⁶) with NaN, ±Inf, 1e308: no non-finite or over-limit DRIVE; a "
            "missing axis is Stop(reason)",
        ),
        "P4": Promise(
            "The decoder is total",
            "8·10⁵ fuzzed bytes (soak: 10⁹): no exception, buffer ≤ 1 KiB, in step again after two good frames (a "
            "Pioneer's: within 258 bytes), any chunking equals the whole; false accepts counted against what CRC-16 "
            "predicts",
        ),
        "P5": Promise(
            "Unplug anywhere",
            "the line cut before every byte of the handshake and every seventh of one full pattern (soak: every "
            "byte; a Pioneer: every 29th), both directions: echoes again ≤ 1 s after replug (a Pioneer, with its "
            "longer handshake: 1.5 s); 320 cycles (soak: 20,000) with flat file descriptors, tasks and memory",
        ),
        "P6": Promise(
            "A stalled peer is harmless",
            "mute, or not reading, for 5 s (soak: 60 s): unsent bytes ≤ 4 KiB, newest command wins, link called dead "
            "≤ 500 ms (a Pioneer, which sends ten times a second: mute ≤ 650 ms, not reading ≤ 1.6 s); bench and "
            "soak: the loop's worst gap ≤ paired control + 5 ms",
        ),
        "P7": Promise(
            "A robot reboot is seen",
            "new boot_id mid-run: pattern sent again, clock and odometry re-based without a jump in the map, "
            "SAFE_STOP until re-armed",
        ),
        "P8": Promise(
            "Crosstalk, ghosts, stuck sensors and rings that lie are caught",
            "pattern changes expose crosstalk; a sensor that never changes or always fails is masked and reported; "
            "a ring that freezes or falls silent, and a robot's clock that is latched, leaps or runs at half or "
            "double speed, at random moments of drives of any shipped robot through any room: a reason or a line "
            "names it, and nothing is touched above .05 m/s; late, duplicate and out-of-window echoes never reach "
            "perception; no honest sensor masked, no honest drive stopped",
        ),
        "P9": Promise(
            "The map recovers from false readings",
            "20 % outliers, a garbage burst, a 1 ft odometry jump: the robot locates objects again within "
            ".05 ft of truth within 20 readings; no ghost of the old frame and no false object survives 10 s",
        ),
        "P10": Promise(
            "No silent death",
            "any task or thread killed or raising: SAFE_STOP within two cycles, the cause named; the deadman is "
            "fed only while all parts report health; never from a thread",
        ),
        "P11": Promise(
            "Configuration cannot half-apply",
            "every field × {missing, wrong type, low, high, typo}: message with path, value, range, nearest name; "
            "1,000 random live reloads (soak: 10⁴) are atomic, the last valid one kept; restart-only fields say so",
        ),
        "P12": Promise(
            "Disk trouble stays on disk",
            "full disk, one that confirms nothing, read-only folder, a log or terminal that accepts nothing: no "
            "cycle waits, the loss is counted and reported; bench: no cycle is late beyond the paired control",
        ),
        "P13": Promise(
            "One owner",
            "a second process on the same port or the same record file is refused with a clear line; a stale lock is "
            "recognised",
        ),
        "P14": Promise(
            "Input files cannot do harm",
            "750 mutated ring logs, worlds, models, robot and run files (soak: 10⁵): clear "
            "error or right result, no traceback, no hang, memory ≤ 500 MB",
        ),
        "P15": Promise(
            "It runs for days",
            "100 s in virtual time: memory growth < 1 MB (soak: 24 h, and 1 h on the pty: slope < 1 MB/h), no "
            "unretrieved task exception, t_us wrap crossed",
        ),
        "P16": Promise("Traceable", "this table is generated from the tests that ran"),
        "P17": Promise(
            "Compiled code is ours",
            "kernels are loaded only from a folder that this user owns and no other can write, or from a new one",
        ),
        "P18": Promise(
            "A late command moves nothing",
            "what can begin a motion carries a challenge of the server; it is refused 1 s later, after any stop of "
            "the robot, and without its sender's connection; HALT needs none",
        ),
        "P19": Promise(
            "Nothing is left over",
            "pages that close while a recording opens, or open many at once; SIGINT, SIGTERM or SIGHUP at any moment "
            "of a start: no process, no folder, no traceback, exit code 128 + n",
        ),
        "P20": Promise(
            "No run deletes the recordings of others",
            "recording switched off and on 100 times, with and without content: a run removes at most as many bytes "
            "as it has written, nothing pinned or bookmarked, and only what it has named before",
        ),
        "P21": Promise(
            "A hostile recording does no harm",
            "every number of a cycle × {NaN, ±Inf, ±1e308, −1, 2⁶³ − 1}: one line of error or a "
            "harmless replay; the same of every number of a keyframe; nothing larger than 64 MiB, or than the "
            "settings' own state, is decompressed; a message takes at most 500 MB; a gap in time is shown as 3 s",
        ),
        "P22": Promise(
            "Floods and lies are harmless",
            "10⁵ commands, pings, endless fragments and headers, clients that never read; echoes far beyond the "
            "pattern's rate, false acknowledgements, a clock 5 % off or backwards, odometry off by kilometres, "
            "hostile names: bounded memory and work per turn, HALT of another client at once, a stop or a message "
            "where it can be decided",
        ),
        "P23": Promise(
            "Nothing is lost for want of room",
            "a hall of twice as many drums as perception has tracks, there and back: all are reported, none twice, "
            "each with its number; where more is near than fits, the farthest wait and are counted; what was left "
            "behind can be edited, and a restored state goes on the same",
        ),
        "P24": Promise(
            "It never drives blind",
            "sensors fail, one, many or all, at random moments of random drives with any pattern: no motion towards "
            "a direction of the body's path without a usable range or believed silence there that is younger than "
            "echo_age_max_s + 0.15 s, and nothing touched, also where nine of ten readings are missing; no echo "
            "counts as younger than the time since it arrived, whatever the robot's clock says; a pattern with which "
            "the robot could not drive is refused wherever it can be set",
        ),
        "P25": Promise(
            "The base is not believed on its word",
            "a flag in any one sample of the odometry stops the drive; an ARM while bumper or motor fault is "
            "reported sends no DRIVE; a base that acknowledges HALT and drives on at .3 m/s: FAULT ≤ 1.2 s later, "
            "HALT again and again; motion without a command, or none for 1 s on command: SAFE_STOP with the reason; "
            "one that brakes, is pushed, or held for .85 s: no false alarm; a deadman "
            "outside the robot file's bounds (.1 to 1 s): refused; no gap of more than .5 s between two cycles is "
            "driven through, whatever the base reports",
        ),
        "P26": Promise(
            "No file that is not ours is destroyed",
            "a full folder of recordings with foreign MCAP files, links, copies, files being written, runs of one "
            "name, a clock set back: only listed and finished recordings are removed; every output of every command "
            "against each of its inputs, every other output and an existing file, also through links: refused, all "
            "content as before",
        ),
        "P27": Promise(
            "No false drum where none stands",
            "rooms of four walls and two boxes without a drum, .3 % noise, 90 s where everything echoes (soak: ten "
            "rooms for thirty minutes each, `cone` and `specular`): at most 1 look in 1,000 with a drum at ≥ .95",
        ),
        "P28": Promise(
            "Anyone's account and terminal",
            "paths that are not UTF-8, no home folder, `~` of no user, streams that are closed, full or ASCII: no "
            "traceback, no folder of the name `~`",
        ),
        "P29": Promise(
            "Robots that people have",
            "an emulated p3dx in the paper's hallway, `specular`, 15 s in virtual time: six drums of six, none "
            "false, error ≤ .02 ft; every driver and its emulated robot keep one contract",
        ),
        "P30": Promise(
            "No jump of the drive at a correction",
            "the map frame corrected by up to 5 m and 30°, at random, 200 times, while the robot drives to a goal in "
            "it: the goal moves in odometry's frame by at most .2 m/s, the velocities follow without a step; "
            "while the place is unknown the robot stands and says so",
        ),
        "P31": Promise(
            "One true state, nothing lost, nothing to guess",
            "the state bar names the robot's mode in every tab, in playback, in a pause, without data; every edit of "
            "the map can be undone, a rejected object does not return; a run with an emulator names its program, not "
            "cables; the first hour of docs/tutorial.md runs as it is written",
        ),
        "P32": Promise(
            "A mission moves nothing by itself and never stands without a reason",
            "120 random missions with random edits, stops and faults, 60 cycles each (soak: 10⁴ of 200): no motion "
            "out of DRIVE, none after a stop before an explicit re-arm and resume, no cycle in DRIVE without motion "
            "or a reason, none 60 s without progress that is not held; ten shipped missions driven in the emulator: "
            "no contact",
        ),
        "P33": Promise(
            "A dead end is neither invented nor a trap",
            "a corridor with doorways of 1.1 m and more, 1 % noise, 5 % drop-outs, 3 % strays: no canyon reported, "
            "one in a dead end (soak: twenty corridors and twenty halls of drums, by both models of reflection; ten "
            "drives to the goal behind the dead end of the shipped office: all arrive, no contact)",
        ),
        "P34": Promise(
            "Tuning finds back what wrong settings lose",
            "a hall with a beam set too wide, without the truth (soak: 20 halls with wrong beam, resolution and "
            "thresholds, 40 trials): ≥ 95 % of the lost recall found again, in ten halls that were held out as well",
        ),
        "P35": Promise(
            "A robot on the network gives nothing away",
            "announced only where the console listens beyond this machine, or when configured: name, mode, address "
            "and version, no token; two runs find each other, and one that ends is gone at once",
        ),
        "P36": Promise(
            "It is never sure of a wrong place",
            "known rooms, an unknown start, 1 % noise, 3 % outliers, 5 % drop-outs, odometry 3 % off: the map of "
            "another room, a wall .6 m from where the map has it, a robot that is carried elsewhere, a room that "
            "looks alike from two places; two drives of each by both models of reflection: no wrong place above "
            ".9 but on the first metre after it was carried (soak: twenty, and in at most one of them); it is found "
            "again within 3 m",
        ),
    }
)  # fmt: skip


@dataclass(frozen=True)
class PromiseTest:
    """Test function that verifies promises; all parameters of one function are one entry.

    A long form may verify none; it is listed for its measurements.
    """

    test: str
    ids: tuple[str, ...]
    soak: bool


@dataclass
class Results:
    """Tests of promises in a run, and their measurements.

    Attributes
    ----------
    tests
        Collected tests, including those deselected later.
    whole
        Whether the whole suite was collected.
    measured
        Measurements of each test that passed.
    failed
        Tests that failed.
    """

    tests: tuple[PromiseTest, ...] = ()
    whole: bool = False
    measured: dict[str, list[str]] = field(default_factory=dict)
    failed: set[str] = field(default_factory=set)

    def add_report(self, report: pytest.TestReport) -> None:
        """Add the report of one phase of a test."""
        properties = [(key, str(value)) for key, value in report.user_properties]
        if not any(key == PROMISE for key, _ in properties):
            return
        test = report.nodeid.split("[")[0]
        if report.failed:
            self.failed.add(test)
        elif report.when == "call" and report.passed:
            known = self.measured.setdefault(test, [])
            known += [value for key, value in properties if key == MEASURED and value not in known]


RESULTS = pytest.StashKey[Results]()


def tests_of(items: Iterable[pytest.Item]) -> tuple[PromiseTest, ...]:
    """Return the tests that verify promises, in the order of collection.

    Raises
    ------
    pytest.UsageError
        A marker has no ID, or an ID that is not in `PROMISES`.
    """
    found: dict[str, PromiseTest] = {}
    for item in items:
        marks = [*item.iter_markers(PROMISE)]
        ids = tuple(dict.fromkeys(one for mark in marks for one in mark.args))
        unknown = [one for one in ids if one not in PROMISES]
        if unknown or (marks and not ids):
            named = ", ".join(map(repr, unknown)) or "no ID"
            raise pytest.UsageError(
                f"{item.nodeid}: @pytest.mark.promise names {named}; known IDs: {', '.join(PROMISES)}; "
                f"correct the ID, or add it to tests/promises.py"
            )
        soak = item.get_closest_marker("soak") is not None
        if ids or soak:
            test = item.nodeid.split("[")[0]
            found[test] = PromiseTest(test, ids, soak and found.get(test, PromiseTest("", (), soak=True)).soak)
    return tuple(found.values())


def unverified(tests: Sequence[PromiseTest]) -> list[str]:
    """Return the IDs without a test in ordinary runs; soak tests alone run too seldom."""
    verified = {one for test in tests if not test.soak for one in test.ids}
    return [one for one in PROMISES if one not in verified]


def collect(config: pytest.Config, items: Sequence[pytest.Item]) -> None:
    """Attach empty results to a run whose tests have been collected and not yet deselected.

    Raises
    ------
    pytest.UsageError
        A test names an unknown ID; or the whole suite was collected and an ID has no test.
    """
    whole = config.args_source is pytest.Config.ArgsSource.TESTPATHS
    results = Results(tests_of(items), whole)
    config.stash[RESULTS] = results
    if whole and (without := unverified(results.tests)):
        raise pytest.UsageError(
            f"no test verifies {', '.join(without)}: mark one with @pytest.mark.promise, or remove the promise from "
            f"tests/promises.py"
        )
