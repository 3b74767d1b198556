"""Which typical changes that break something the quick check misses: `python -m tests.mutation.quick_check`.

Each is made in a copy of the last commit, where `python -m tests.changed` then runs. All fail in the whole suite.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Final, NamedTuple

ROOT: Final = Path(__file__).resolve().parents[2]


class Change(NamedTuple):
    """A change of one place of a file."""

    kind: str
    path: str
    old: str
    new: str


FAULT: Final = "    fault: str | None = None\n"
DISTANCE: Final = "    distance_m: float | None"
HEADLESS: Final = "    headless: Annotated[bool"
AGE: Final = "echo_age_max_s: float = Field(default=1.5, gt="
CHANGES: Final = (
    Change("schema", "behaviors/wander.py", "if free_m > best_free_m:", "if free_m < best_free_m:"),
    Change("decode", "drivers/arcos/codec.py", '"H", reading.range_raw)', '"H", reading.range_raw + 1)'),
    Change("model", "config/models/drum.toml", "arc_radius_m = 0.3048", "arc_radius_m = 0.32"),
    Change("message", "runtime/console/frames/state_message.py", "    paused: bool\n", "    is_paused: bool\n"),
    Change("record", "runtime/cycle/inputs.py", FAULT, f"{FAULT}    n: int = 0\n"),
    Change("setting", "config/behaviors.py", DISTANCE, f"    way_m: float = 1.0\n{DISTANCE}"),
    Change(
        "option", "runtime/cli/commands/run/run.py", HEADLESS, f"    mute: Annotated[bool, Flag] = False,\n{HEADLESS}"
    ),
    Change("kernel", "perception/bayes/circles/posterior.py", "saa += w * a * a", "saa += w * a"),
    Change("document", "docs/library-virtual-time.md", "hall, _ = random_hall(seed)", "hall = random_hall(seed)"),
    Change("bound", "config/behaviors.py", f"{AGE}0.0", f"{AGE}1.0"),
    Change("page", "runtime/console/page/parameters.js", '"set_parameter", path', '"set_parameters", path'),
    Change("schema's name", "config/mission_step.py", 'name: Literal["swirl"]', 'name: Literal["swirls"]'),
    Change("default", "config/robot.py", "tries: int = Field(default=3", "tries: int = Field(default=4"),
    Change("first hour", "docs/tutorial.md", "echolocate check ", "echolocate checks "),
    Change("bound of a state", "perception/bounds.py", "FLAG: Final = Bound(0, 1)", "FLAG: Final = Bound(0, 0)"),
    Change("capability", "drivers/capabilities.py", '        "latch": ', '        "latched": '),
)
"""Those of the ten kinds that are asked for first, then others."""


def missed(changes: Iterable[Change], python: str = sys.executable) -> list[str]:
    """Make each change, run the quick check, print what it found and how long it took; return what it missed."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "copy"
        subprocess.run(["git", "worktree", "add", "-q", "--detach", copy, "HEAD"], cwd=ROOT, check=True)
        try:
            return [change.kind for change in changes if not _is_detected(change, copy, python)]
        finally:
            subprocess.run(["git", "worktree", "remove", "--force", copy], cwd=ROOT, check=True)


def _is_detected(change: Change, copy: Path, python: str) -> bool:
    file = copy / change.path
    text = file.read_text("utf-8")
    file.write_text(text.replace(change.old, change.new, 1), "utf-8")
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([python, "-m", "tests.changed"], cwd=copy, capture_output=True, text=True, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    file.write_text(text, "utf-8")
    cpu_s = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    failed = [line.split()[1] for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR "))]
    said = failed[0] if failed else "collection" if done.returncode else "MISSED"
    sys.stdout.write(f"{change.kind:18} {change.path:42} {cpu_s:5.1f} s  {len(failed):3} failed: {said}\n")
    sys.stdout.flush()
    return done.returncode != 0


if __name__ == "__main__":
    kinds = {*sys.argv[1:]}
    lacking = missed(change for change in CHANGES if not kinds or change.kind in kinds)
    sys.stdout.write(f"missed: {', '.join(lacking) or 'none'}\n")
    sys.exit(bool(lacking))
