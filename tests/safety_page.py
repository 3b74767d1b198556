"""docs/safety.md, made from the lists that `echolocate check` speaks by: `python -m tests.safety_page` writes it."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from config.files import list_shipped
from config.load import load_robot
from drivers.capabilities import CAPABILITIES, moves_on
from drivers.registry import deadman_s

PAGE: Final = Path(__file__).resolve().parents[1] / "docs" / "safety.md"
TEXT: Final = """# Safety

What follows for safety from what a robot can do and what it lacks, made from the program by `python -m
tests.safety_page`. `echolocate check FILE` says the same of a robot file, also of a robot that a package adds.

While this program runs, it stops the robot on every fault that it finds; [its promises](promises.md) say which, and
how soon. What it cannot do is stop a robot after it was killed itself: then only the base can.

## After kill -9, or with the cable unplugged

A base with a deadman stops by itself when no velocity has come for a time. Until then, and while it brakes, it moves.
The table is for the shipped files and the worst case that each allows: full speed, and the longest deadman with which
a run begins (`link.deadman_max_s`; `rflex.fail_safe_s`, `ros2.deadman_s`). A base with a longer one is refused. A
shorter deadman, a lower `body.speed_max_m_s` or better brakes (`body.acceleration_max_m_s2`) make all smaller.
On a base that does not brake as its file says they do not hold: measure it, with its wheels on the ground.

| robot | deadman at most | brakes for | moves for at most | way at most |
|---|---|---|---|---|
{robots}

## What a robot lacks

A driver's family lists in `HAS` what its robots can do; one that lists nothing can do all, and its contract has
tested that. For each that is missing, `check` says:

| not in `HAS` | what follows |
|---|---|
{capabilities}

The contract of drivers (`pytest --echolocate-family NAME`) leaves out the promises that need what is missing, and
names them. It finds a list that says too much: [a robot](extending.md#a-robot).
"""


def page() -> str:
    """Return the page, in Markdown."""
    robots = []
    for name in list_shipped("robots"):
        robot = load_robot(name)
        found = moves_on(robot.body, deadman_s(robot))
        cells = ["none", "", "until it is switched off", ""]
        if found is not None:
            cells = [f"{found.deadman_s:g} s", *(f"{s:.2f} s" for s in (found.brakes_s, found.lasts_s))]
            cells.append(f"{found.way_m:.2f} m")
        robots.append(" | ".join((f"| `{name}`", *cells)) + " |")
    lacking = [f"| `{name}` | {text} |" for name, text in CAPABILITIES.items()]
    return TEXT.format(robots="\n".join(robots), capabilities="\n".join(lacking))


if __name__ == "__main__":
    PAGE.write_text(page(), "utf-8")
