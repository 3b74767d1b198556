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


LIMITS: Sequence[str] = (
    "A ring that falls silent as a whole where little was ahead or beside it, or whose sensors each fire seldom: "
    "most such silences are named at once, others by a line after half a metre or half a turn, or after twice the "
    "longest silence so far if that is more. After 4 m without anything new the robot creeps. What it had not heard "
    "before may be touched until then.",
    "Ranges that have been too long, or too short, by the same length since the ring's first readings, or that "
    "become so where the ring hears few echoes at that moment (three to eight: in 11 of 32 drives of rings of "
    "8, 16 and 24 sensors among mirrors something was touched when ranges became too long, in 0 of 16 when "
    "they became too short; through furnished rooms, offices and corridors in 13 of 48, and in 0 of 27): they "
    "change as the robot's motion says. "
    "A map of the room contradicts them; without one, only a bumper stops the robot.",
    "A ring that hears nothing from its first reading on: the robot creeps at 0.04 m/s, says why, and is stopped "
    "after 1 m; what stands within it is touched at no more. If the ring reaches less than 3 m, which hears a room "
    "late, the robot drives as usual, and is stopped after 4 m less its reach (`servo1`: 2.3 m; 3 of 12 drives among "
    "mirrors touched something). So does an honest ring in the open.",
    "A part of the ring that freezes or falls silent while the rest still hears: a sensor that does not change is "
    "named after a metre or two on which its neighbours change, and what stood ahead may be touched before. Half of "
    "the ring that freezes is named after 0.3 to 6 s (30 of 30 drives), but one by one, from its edge: where no "
    "neighbour changes, sensors are believed, and in 6 of 30 drives something was touched, at up to 0.3 m/s, after 5 "
    "to 19 s. Where all that looks ahead falls silent it was so in 6 of 25, after 7 to 13 s; where nine of ten "
    "readings of every sensor are reported as silence, as of a mirror, in 4 of 29, although each was named before.",
    "Sensors that do not hear what is near, where they have heard nothing of it from farther away: a wall along "
    "which the robot drives goes on, and one that turns into it has never heard that part.",
    "Echoes of an earlier drive that fit the present one, until they come again: replays in a corridor along its "
    "walls, or of a drive like this one. They change as the motion says, and what returns to an earlier place are a "
    "few sensors ahead and behind. When they come again they are equal to the bit.",
    "A ring that is mounted turned by a small angle, until the objects that result are seen to be wrong: measure "
    "it with `echolocate calibrate`. Two sensors exchanged, one that looks backwards, or one that hears nothing, "
    "in a ring of up to sixteen: with `body.turns_at_start` they are named by a turn before the first drive (280 "
    "of 288); without it, or where they become so later, only once the robot has turned by about 60°, or by half "
    "a turn on one spot: 4 to 40 s in drives through rooms. The turn knows only what the other sensors hear: it "
    "names nothing where nothing echoes, nor a single sensor that looks backwards, nor the two of a pair that "
    "are exchanged. In a ring of more sensors they are not named at all. One of eight or fewer that is turned "
    "otherwise, and a ring that is turned by a half among few surfaces, as in a corridor: 6 of 16 drives of rings of "
    "8, 16 and 24 sensors then touched something, 1 of 16 turned by a quarter, and 0 of 16 by 45°. Mounted so from "
    "the start (by a half, as a Pioneer is whose two arrays are exchanged), the robot is slow where something would"
    " be ahead, until the motion has excluded that: among close furniture and in corridors six robots touched "
    "something above 0.05 m/s in 6 of 168 drives of 20 s, at up to 0.26 m/s, five of them with eight sensors, which "
    "hear little. A robot that seems turned creeps for up to 20 s before it is named. One sensor on a servo "
    "looks in each direction too seldom for that, and a ring that only looks ahead hears nothing of what is then "
    "ahead of a half turn. A `p3dx` with a disc at the front and one at the back exchanged touched something in 3 "
    "of 27.",
    "Any lie while the robot stands, or among surfaces whose ranges its motion does not change: nothing differs "
    "then; after half a metre or half a turn of repeated echoes, or twice the longest such silence so far, the robot "
    "creeps, and after 4 m of silence. Where nothing echoes, silence is true and false alike.",
    "An object that appears nearer than the way that the robot drives until the ring next looks there, and then "
    "brakes: at .3 m/s an object set .1 m ahead of the rim is hit by every robot that drives straight at it, "
    "since it is there after .33 s.",
    "Something that is no recognised model and that no beam meets, or that returns no echo: glass at a "
    "slant, cloth, what is above or below the beams, or the end of a thin wall or a leg between two beams. Beams "
    "that overlap at a distance leave gaps near a ring: those of the Denning within half a metre. "
    "Beams that end side by side leave a strip at any range, 6 cm wide between the AmigoBot's: a drum that reflects "
    "like a mirror is not heard in it, and `check` says so.",
    "A smooth wall whose normal lies in a blind side of the ring: a robot that only looks ahead hears nothing of it "
    "as it draws near at a slant. Such a robot turns and looks to both sides every 2.5 m, remembers the walls that "
    "it heard, and presumes that they go on; a wall that begins between two looks is not known. A ring that does not "
    "turn with the wheels cannot look: a goal or mission that leads to its blind side is refused. Nor does a ring "
    "all round hear such a wall between two beams that do not touch, as 10° at 70° from ahead of a `p3at`: what "
    "it heard of the wall before counts there for a metre, what it never heard does not.",
    "A robot's clock that is wrong by less than a twentieth, or by little more: a note after a minute, no stop.",
    "Odometry that counts too little, or too much by less than a quarter, or that stands for moments of less than a "
    "second: a base may be slower than commanded. The map suffers, and the distances that are kept do not; with half "
    "or 0.7 of the way something was touched in 1 of 20 drives. What counts half as much again is named (10 of 10).",
)
"""What nothing that the robot reports can contradict, so that no stop and no message is promised."""

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
        ids = tuple(dict.fromkeys(one for mark in item.iter_markers(PROMISE) for one in mark.args))
        unknown = [one for one in ids if one not in PROMISES]
        if unknown or (not ids and item.get_closest_marker(PROMISE) is not None):
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
