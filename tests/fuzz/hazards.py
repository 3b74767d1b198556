"""Reads files designed to exhaust memory or time, in a process of its own.

`python -m tests.fuzz.hazards SHARE` prints the cost of each as JSON; its files have this share of the full size. Most
exploit how tomllib, csv and pydantic work: cost quadratic in the length of a dotted key, rows joined by a quote, and
lists that are multiplied with one another.
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
from runtime.timing.footprint import peak_mb
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


def toml(size: int, text: str) -> bytes:
    """Return the first `size` bytes of a text."""
    return text.encode()[:size]


def repeated(size: int, entry: str, end: str = "]") -> str:
    """Return list entries up to about `size` bytes, and the end of the list."""
    return (entry * (size // len(entry)))[: size - 200].rpartition(",")[0] + end


def nested(begin: str, end: str, depth: int) -> str:
    """Return an assignment of brackets nested `depth` times."""
    return "a = " + begin * depth + end * depth


def with_firing(size: int, text: str) -> bytes:
    """Return a valid robot file with the given `[ring.firing]`."""
    return toml(
        size,
        "[ring]\ncount = 24\nradius_m = 0.4\nbeam_half_angle_deg = 12.0\nresolution_m = 0.03\nrange_min_m = 0.15\n"
        "range_max_m = 7.0\n[body]\nradius_m = 0.4\nspeed_max_m_s = 0.5\nturn_max_rad_s = 1.0\n"
        f"[ring.firing]\n{text}\n",
    )


TOML: dict[str, Callable[[int], bytes]] = {
    "a dotted key": lambda n: toml(n, ".".join(["a"] * (n // 2 - 4)) + " = 1"),
    "a dotted key, spaced": lambda n: toml(n, " . ".join(["a"] * (n // 4 - 4)) + " = 1"),
    "a dotted key, quoted": lambda n: toml(n, " . ".join(['"\\""'] * (n // 8)) + " = 1"),
    "a dotted key, quoted 'literally'": lambda n: toml(n, ".".join(["''"] * (n // 4)) + " = 1"),
    "a dotted key of long parts": lambda n: toml(n, ".".join(['"' + "x" * 260 + '"'] * (n // 264)) + " = 1"),
    "a dotted key in a table": lambda n: toml(n, "a = {" + ".".join(["a"] * (n // 2 - 8)) + " = 1}"),
    "a dotted header": lambda n: toml(n, "[" + ".".join(["a"] * (n // 2 - 4)) + "]"),
    "many dotted keys": lambda n: toml(n, "\n".join(".".join(["a"] * 30) + f".k{i} = 1" for i in range(n // 20))),
    "quotes": lambda n: toml(n, "a = '''" + '"' * (n - 20) + "'''"),
    "escaped quotes": lambda n: toml(n, 'a = "' + '\\"' * (n // 2 - 10) + '"'),
    "quotes in a comment": lambda n: toml(n, "#" + '"\\' * (n // 2 - 10)),
    "a long word": lambda n: toml(n, "a" * (n - 20) + " = 1"),
    "spaces": lambda n: toml(n, "a" + " " * (n - 20) + " = 1"),
    "nested lists": lambda n: toml(n, nested("[", "]", n // 2 - 10)),
    "nested lists, 300": lambda n: toml(n, nested("[", "]", 300)),
    "nested tables": lambda n: toml(n, nested("{a = ", "}", n // 8)),
    "an unclosed list": lambda n: toml(n, "a = " + "[" * (n - 10)),
    "tables": lambda n: toml(n, "\n".join(f"[a{i}]" for i in range(n // 3))),
    "tables in a list": lambda n: toml(n, "[[drum]]\n" * (n // 9)),
    "keys": lambda n: toml(n, "\n".join(f"k{i} = 1" for i in range(n // 3))),
    "digits": lambda n: toml(n, "a = " + "1" * (n - 10)),
    "decimal places": lambda n: toml(n, "a = 0." + "1" * (n - 10)),
    "hexadecimal digits": lambda n: toml(n, "a = 0x" + "f" * (n - 10)),
    "a list of numbers": lambda n: toml(n, "a = [" + repeated(n, "1,")),
    "a gigabyte of zeros": lambda _n: b"",
    "sets": lambda n: with_firing(n, "rotations = 255\nsets = [" + repeated(n, "[0],")),
    "a set": lambda n: with_firing(n, "sets = [[" + repeated(n, "0,", "]]")),
    "a set with a huge sensor index": lambda n: with_firing(n, "sets = [[9223372036854775807]]"),
    "the largest number of sets": lambda n: with_firing(n, "rotations = 255\nsets = [" + "[0,1,2]," * 254 + "[3]]"),
    "drums": lambda n: toml(n, "drum = [" + repeated(n, "{x_m=1.0,y_m=2.0,radius_m=0.3},")),
    "vertices of a polygon": lambda n: toml(n, "polygon = [{vertices_m = [" + repeated(n, "[0.0,1.0],", "]}]")),
    "sensors": lambda n: toml(n, "[ring]\nsensors = [" + repeated(n, "{x_m=0.1,y_m=0.1,angle_deg=0.0},")),
    "vertices of a model": lambda n: toml(n, "name = 'm'\nclosed = true\nvertices_m = [" + repeated(n, "[0.0,1.0],")),
    "models": lambda n: toml(n, "robot = 'denning'\nmodels = [" + repeated(n, '"box",')),
    "inline models": lambda n: toml(n, "robot = 'denning'\nmodels = [" + repeated(n, "{name='a'},")),
}
"""Files by name, as functions of their largest size, bytes."""

LOGS: dict[str, Callable[[float], bytes]] = {
    "a log: an unclosed quote": lambda share: RING_LOG + b'"a' + b'","\n' * int(5e6 * share),
    "a log: an endless line": lambda share: RING_LOG + b"1," * int(2e7 * share),
    "a log: columns": lambda share: (
        b"t,x,y,theta," + b",".join(b"r%02d" % i for i in range(int(1e6 * share))) + b"\n"
    ),
    "a log: blank lines": lambda share: RING_LOG + b"\n" * int(1e6 * share) + b"x",
    "a log: a gigabyte of zeros": lambda _share: b"",
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


def main(share: float) -> None:
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_SPACE, ADDRESS_SPACE))
    costs = {}
    with tempfile.TemporaryDirectory(dir=MEMORY_DISK if MEMORY_DISK.is_dir() else None) as folder:
        for name in HAZARDS:
            path = Path(folder) / ("hazard.csv" if name in LOGS else "hazard.toml")
            path.write_bytes(LOGS[name](share) if name in LOGS else TOML[name](int(share * SIZE_MAX)))
            if "gigabyte" in name:
                with path.open("r+b") as file:
                    file.truncate(GIGABYTE)
            costs[name] = cost(path, read_whole_ring_log if name in LOGS else read_run)
            path.unlink()
    memory_mb = round(peak_mb() or 0.0)
    sys.stdout.write(json.dumps({"cases": costs, "memory_mb": memory_mb}))


if __name__ == "__main__":
    main(float(sys.argv[1]))
