"""Files made to exhaust memory or time, against what reads them, in a process of its own.

`python -m tests.fuzz.hazards` prints what each cost as JSON. Most were found in how tomllib, csv and pydantic
work: the square of a dotted key's length, rows that a quote joins, and lists that are multiplied with one another.
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
from tests.fuzz.campaign import ADDRESS_SPACE, MEMORY_DISK, RING_LOG, complaint_of, take_ring_log, take_run

GIGABYTE = 1 << 30


def toml(text: str) -> bytes:
    """Return as much of `text` as a settings file may be long, cut at a line where there is one."""
    return text.encode()[:SIZE_MAX]


def listed(entry: str, end: str = "]") -> str:
    return (entry * (SIZE_MAX // len(entry)))[: SIZE_MAX - 200].rpartition(",")[0] + end


def deep(begin: str, end: str, depth: int) -> str:
    return "a = " + begin * depth + end * depth


def with_firing(text: str) -> bytes:
    """Return a regular robot file with a `[ring.firing]` of its own."""
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
    "lists in lists": lambda: toml(deep("[", "]", SIZE_MAX // 2 - 10)),
    "lists in lists, 300": lambda: toml(deep("[", "]", 300)),
    "tables in tables": lambda: toml(deep("{a = ", "}", SIZE_MAX // 8)),
    "an unended list": lambda: toml("a = " + "[" * (SIZE_MAX - 10)),
    "tables": lambda: toml("\n".join(f"[a{i}]" for i in range(100_000))),
    "tables in a list": lambda: toml("[[drum]]\n" * (SIZE_MAX // 9)),
    "keys": lambda: toml("\n".join(f"k{i} = 1" for i in range(80_000))),
    "digits": lambda: toml("a = " + "1" * (SIZE_MAX - 10)),
    "digits of a fraction": lambda: toml("a = 0." + "1" * (SIZE_MAX - 10)),
    "hexadecimal digits": lambda: toml("a = 0x" + "f" * (SIZE_MAX - 10)),
    "numbers": lambda: toml("a = [" + listed("1,")),
    "a gigabyte": lambda: b"",
    "sets": lambda: with_firing("rotations = 255\nsets = [" + listed("[0],")),
    "a set": lambda: with_firing("sets = [[" + listed("0,", "]]")),
    "a set of a far sensor": lambda: with_firing("sets = [[9223372036854775807]]"),
    "as many sets as may be": lambda: with_firing("rotations = 255\nsets = [" + "[0,1,2]," * 254 + "[3]]"),
    "drums": lambda: toml("drum = [" + listed("{x_m=1.0,y_m=2.0,radius_m=0.3},")),
    "corners of a thing": lambda: toml("polygon = [{vertices_m = [" + listed("[0.0,1.0],", "]}]")),
    "sensors": lambda: toml("[ring]\nsensors = [" + listed("{x_m=0.1,y_m=0.1,angle_deg=0.0},")),
    "corners": lambda: toml("name = 'm'\nclosed = true\nvertices_m = [" + listed("[0.0,1.0],")),
    "models": lambda: toml("robot = 'denning'\nmodels = [" + listed('"box",')),
    "models of its own": lambda: toml("robot = 'denning'\nmodels = [" + listed("{name='a'},")),
}

LOGS: dict[str, Callable[[], bytes]] = {
    "a log: an unended quote": lambda: RING_LOG + b'"a' + b'","\n' * 5_000_000,
    "a log: a line without end": lambda: RING_LOG + b"1," * 20_000_000,
    "a log: columns": lambda: b"t,x,y,theta," + b",".join(b"r%02d" % i for i in range(1_000_000)) + b"\n",
    "a log: blank lines": lambda: RING_LOG + b"\n" * 1_000_000 + b"x",
    "a log: zeros, a gigabyte": lambda: b"",
}
HAZARDS = (*TOML, *LOGS)


def cost(path: Path, take: Callable[[Path], None]) -> dict[str, Any]:
    """Return what reading the file took, and what hurt."""
    begun_s = time.process_time()
    hurt: str | None = None
    try:
        said = complaint_of(take, path)
        if said is not None and not all(line.isprintable() and len(line) < 1000 for line in said.split("\n")):
            hurt = f"no clear line: {said[:300]!r}"
    except Exception as error:  # noqa: BLE001 - that is what is looked for
        hurt = f"{take.__name__}: {type(error).__name__}: {error}"[:400]
    return {"cpu_s": round(time.process_time() - begun_s, 3), "hurt": hurt}


def main() -> None:
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_SPACE, ADDRESS_SPACE))
    told = {}
    with tempfile.TemporaryDirectory(dir=MEMORY_DISK if MEMORY_DISK.is_dir() else None) as folder:
        for name, make in (TOML | LOGS).items():
            path = Path(folder) / ("hazard.csv" if name in LOGS else "hazard.toml")
            path.write_bytes(make())
            if "gigabyte" in name:
                with path.open("r+b") as file:
                    file.truncate(GIGABYTE)
            told[name] = cost(path, take_ring_log if name in LOGS else take_run)
            path.unlink()
    memory_mb = round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
    sys.stdout.write(json.dumps({"cases": told, "memory_mb": memory_mb}))


if __name__ == "__main__":
    main()
