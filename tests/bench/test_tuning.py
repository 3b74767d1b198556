"""`echolocate tune` with Optuna and Dask: what it finds back in halls, and a search whose process is killed."""

from __future__ import annotations

import random
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from bench.tuning import measure, recovered, write_halls
from config.load import load_settings

KILLS = 5
TIMEOUT_S = 900.0
STUDY = """
recordings = "logs"
truth = "truth"
models = ["drum"]
sets = ["ring.beam_half_angle_deg=24.0"]
objectives = ["f1"]
[[vary]]
setting = "ring.beam_half_angle_deg"
range = [4.0, 40.0]
"""


@pytest.mark.soak
@pytest.mark.promise("P34")
def test_twenty_halls_with_wrong_settings(tmp_path: Path, measured: Callable[[str], None]) -> None:
    rows = measure(tmp_path, range(30), trials=40, workers=2, blind=False)
    shares = [100.0 * recovered(rows, part) for part in ("searched", "held_out")]
    measured(f"20 halls: {shares[0]:.1f} % of the lost recall found again, in 10 others {shares[1]:.1f} %")
    assert min(shares) >= 95.0


@pytest.mark.soak
def test_a_killed_search_goes_on_to_the_same_end(tmp_path: Path) -> None:
    write_halls(tmp_path, load_settings("hallway").ring, range(3))
    (tmp_path / "study.toml").write_text(STUDY)
    rng = random.Random(3)
    found = []
    for out, kills in (("whole", 0), ("killed", KILLS)):
        command = [sys.executable, "-m", "runtime.cli", "tune", "study.toml", "--out", out, "--trials", "8"]
        rows = tmp_path / out / "rows"
        for _ in range(kills):
            with subprocess.Popen([*command, "--workers", "2"], cwd=tmp_path, stdout=subprocess.DEVNULL) as process:
                wanted = len(list(rows.glob("*.json"))) + rng.randrange(1, 4)
                deadline_s = time.monotonic() + TIMEOUT_S
                while len(list(rows.glob("*.json"))) < wanted and process.poll() is None:
                    assert time.monotonic() < deadline_s
                    time.sleep(0.02)
                process.kill()
        subprocess.run([*command, "--workers", "1"], cwd=tmp_path, check=True, timeout=TIMEOUT_S)
        found.append([(tmp_path / out / name).read_text() for name in ("tuned.toml", "trials.csv")])
    changes, trials = zip(*found, strict=True)
    assert changes[0] == changes[1]
    assert len(trials[0].splitlines()) == len(trials[1].splitlines()) == 2 + 8
