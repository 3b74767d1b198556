"""Reads files designed to exhaust memory or time, in a process of its own.

`python -m tests.fuzz.hazards` prints the cost of each as JSON. Most exploit how tomllib, csv and pydantic work: cost
quadratic in the length of a dotted key, rows joined by a quote, and lists that are multiplied with one another.
"""

from __future__ import annotations

import json
import resource
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from config.files import SIZE_MAX
from tests.fuzz.campaign import (
    ADDRESS_SPACE,
    LINE_MAX,
    MEMORY_DISK,
    RING_LOG,
    error_message,
    read_run,
    read_whole_ring_log,
)

GIGABYTE = 1 << 30


def toml(text: str) -> bytes:
    """Return the start of `text`, up to the largest size of a settings file."""
    return text.encode()[:SIZE_MAX]


def repeated(entry: str, end: str = "]") -> str:
    """Return list entries up to about the largest size of a settings file, and the end of the list."""
    return (entry * (SIZE_MAX // len(entry)))[: SIZE_MAX - 200].rpartition(",")[0] + end


def nested(begin: str, end: str, depth: int) -> str:
    """Return an assignment of brackets nested `depth` times."""
    return "a = " + begin * depth + end * depth


def with_firing(text: str) -> bytes:
    """Return a valid robot file with the given `[ring.firing]`."""
    return toml(
        "[ring]\ncount = 24\nradius_m = 0.4\nbeam_half_angle_deg = 12.0\nresolution_m = 0.03\nrange_min_m = 0.15\n"
        "range_max_m = 7.0\n[body]\nradius_m = 0.4\nspeed_max_m_s = 0.5\nturn_max_rad_s = 1.0\n"
        f"[ring.firing]\n{text}\n"
    )


TOML: dict[str, Callable[[], bytes]] = {
    "a dotted key": lambda: toml(".".join(["a"] * (SIZE_MAX // 2 - 4)) + " = 1"),
    "a dotted key, spaced": lambda: toml(" . ".join(["a"] * (SIZE_MAX // 4 - 4)) + " = 1"),
    "a dotted key, quoted": lambda: toml(" . ".join(['"\\""'] * (SIZE_MAX // 8)) + " = 1"),
    "a dotted key, quoted 'literally'": lambda: toml(".".join(["''"] * (SIZE_MAX // 4)) + " = 1"),
    "a dotted key of long parts": lambda: toml(".".join(['"' + "x" * 260 + '"'] * (SIZE_MAX // 264)) + " = 1"),
    "a dotted key in a table": lambda: toml("a = {" + ".".join(["a"] * (SIZE_MAX // 2 - 8)) + " = 1}"),
    "a dotted header": lambda: toml("[" + ".".join(["a"] * (SIZE_MAX // 2 - 4)) + "]"),
    "many dotted keys": lambda: toml("\n".join(".".join(["a"] * 30) + f".k{i} = 1" for i in range(15_000))),
    "quotes": lambda: toml("a = '''" + '"' * (SIZE_MAX - 20) + "'''"),
    "escaped quotes": lambda: toml('a = "' + '\\"' * (SIZE_MAX // 2 - 10) + '"'),
    "quotes in a comment": lambda: toml("#" + '"\\' * (SIZE_MAX // 2 - 10)),
    "a long word": lambda: toml("a" * (SIZE_MAX - 20) + " = 1"),
    "spaces": lambda: toml("a" + " " * (SIZE_MAX - 20) + " = 1"),
    "nested lists": lambda: toml(nested("[", "]", SIZE_MAX // 2 - 10)),
    "nested lists, 300": lambda: toml(nested("[", "]", 300)),
    "nested tables": lambda: toml(nested("{a = ", "}", SIZE_MAX // 8)),
    "an unclosed list": lambda: toml("a = " + "[" * (SIZE_MAX - 10)),
    "tables": lambda: toml("\n".join(f"[a{i}]" for i in range(100_000))),
    "tables in a list": lambda: toml("[[drum]]\n" * (SIZE_MAX // 9)),
    "keys": lambda: toml("\n".join(f"k{i} = 1" for i in range(80_000))),
    "digits": lambda: toml("a = " + "1" * (SIZE_MAX - 10)),
    "decimal places": lambda: toml("a = 0." + "1" * (SIZE_MAX - 10)),
    "hexadecimal digits": lambda: toml("a = 0x" + "f" * (SIZE_MAX - 10)),
    "a list of numbers": lambda: toml("a = [" + repeated("1,")),
    "a gigabyte of zeros": lambda: b"",
    "sets": lambda: with_firing("rotations = 255\nsets = [" + repeated("[0],")),
    "a set": lambda: with_firing("sets = [[" + repeated("0,", "]]")),
    "a set with a huge sensor index": lambda: with_firing("sets = [[9223372036854775807]]"),
    "the largest number of sets": lambda: with_firing("rotations = 255\nsets = [" + "[0,1,2]," * 254 + "[3]]"),
    "drums": lambda: toml("drum = [" + repeated("{x_m=1.0,y_m=2.0,radius_m=0.3},")),
    "vertices of a polygon": lambda: toml("polygon = [{vertices_m = [" + repeated("[0.0,1.0],", "]}]")),
    "sensors": lambda: toml("[ring]\nsensors = [" + repeated("{x_m=0.1,y_m=0.1,angle_deg=0.0},")),
    "vertices of a model": lambda: toml("name = 'm'\nclosed = true\nvertices_m = [" + repeated("[0.0,1.0],")),
    "models": lambda: toml("robot = 'denning'\nmodels = [" + repeated('"box",')),
    "inline models": lambda: toml("robot = 'denning'\nmodels = [" + repeated("{name='a'},")),
}

LOGS: dict[str, Callable[[], bytes]] = {
    "a log: an unclosed quote": lambda: RING_LOG + b'"a' + b'","\n' * 5_000_000,
    "a log: an endless line": lambda: RING_LOG + b"1," * 20_000_000,
    "a log: columns": lambda: b"t,x,y,theta," + b",".join(b"r%02d" % i for i in range(1_000_000)) + b"\n",
    "a log: blank lines": lambda: RING_LOG + b"\n" * 1_000_000 + b"x",
    "a log: a gigabyte of zeros": lambda: b"",
}
HAZARDS = (*TOML, *LOGS)


def cost(path: Path, read: Callable[[Path], None]) -> dict[str, Any]:
    """Return the CPU time of reading the file, s, and the failure if there was one."""
    start_s = time.process_time()
    failure: str | None = None
    try:
        message = error_message(read, path)
        lines = [] if message is None else message.split("\n")
        if not all(line.isprintable() and len(line) < LINE_MAX for line in lines):
            failure = f"not a clear line: {lines[0][:300]!r}"
    except Exception as error:  # noqa: BLE001 - any other exception is a failure
        failure = f"{read.__name__}: {type(error).__name__}: {error}"[:400]
    return {"cpu_s": round(time.process_time() - start_s, 3), "failure": failure}


def main() -> None:
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_SPACE, ADDRESS_SPACE))
    costs = {}
    with tempfile.TemporaryDirectory(dir=MEMORY_DISK if MEMORY_DISK.is_dir() else None) as folder:
        for name, make in (TOML | LOGS).items():
            path = Path(folder) / ("hazard.csv" if name in LOGS else "hazard.toml")
            path.write_bytes(make())
            if "gigabyte" in name:
                with path.open("r+b") as file:
                    file.truncate(GIGABYTE)
            costs[name] = cost(path, read_whole_ring_log if name in LOGS else read_run)
            path.unlink()
    memory_mb = round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
    sys.stdout.write(json.dumps({"cases": costs, "memory_mb": memory_mb}))


if __name__ == "__main__":
    main()
