"""The fuzzers' targets: quickly on seeds and what hypothesis makes of them, at length guided by coverage."""

from __future__ import annotations

import importlib.util
import random
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, target
from hypothesis import strategies as st

from drivers.denning.codec import Decoder, encode
from drivers.denning.frames import Ack, Frame
from drivers.messages import Firing, Pose
from tests.fuzz.targets import LOG, SEEDS, TARGETS
from tests.promises import ROOT

SOAK_S = 120


@pytest.mark.parametrize("name", TARGETS)
def test_seeds_and_what_is_near_them(name: str) -> None:
    rng = random.Random(5)
    for seed in SEEDS[name]:
        TARGETS[name](seed)
        for _ in range(20):
            spoilt = bytearray(seed + rng.choice(SEEDS[name]))
            for _ in range(rng.randint(1, 4)):
                spoilt[rng.randrange(len(spoilt))] = rng.randrange(256)
            TARGETS[name](bytes(spoilt[rng.randrange(3) :]))


@pytest.mark.parametrize("name", TARGETS)
@settings(deadline=None, max_examples=60)
@given(data=st.data())
def test_anything(name: str, data: st.DataObject) -> None:
    whole = data.draw(st.lists(st.one_of(st.binary(max_size=200), st.sampled_from(SEEDS[name])), max_size=6))
    told = b"".join(whole)
    target(float(len(told)))
    TARGETS[name](told)


def test_a_target_notices(monkeypatch: pytest.MonkeyPatch) -> None:
    """A reader that lets time go back, and a decoder that depends on the chunking, do not pass."""
    firings = [Firing(t_s, Pose(0.0, 0.0, 0.0), 0.0, np.zeros(3)) for t_s in (1.0, 0.5)]
    monkeypatch.setattr("tests.fuzz.targets.read_ring_log", lambda _: iter(firings))
    with pytest.raises(AssertionError):
        TARGETS["ring_log"](LOG)

    class Forgetful(Decoder):
        def feed(self, data: bytes) -> list[Frame]:
            return super().feed(data[:30])

    monkeypatch.setattr("tests.fuzz.targets.Decoder", Forgetful)
    with pytest.raises(AssertionError):
        TARGETS["decoder"](b"\4" + 5 * SEEDS["decoder"][-1][1:] + 5 * encode(Ack(1, 1)))


@pytest.mark.soak
@pytest.mark.promise("P4")
@pytest.mark.parametrize("name", TARGETS)
def test_guided_by_coverage(name: str, tmp_path: Path, measured: Callable[[str], None]) -> None:
    if importlib.util.find_spec("atheris") is None:
        pytest.skip("atheris is not installed: pip install --editable '.[fuzz]'")
    command = [sys.executable, "-m", "tests.fuzz", name, str(SOAK_S), str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, text=True, capture_output=True, timeout=SOAK_S + 120.0, check=False)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-6000:]
    said = done.stdout + done.stderr
    runs, edges = re.search(r"Done (\d+) runs", said), re.findall(r"cov: (\d+)", said)
    assert runs is not None, said[-2000:]
    measured(f"atheris on {name}: {int(runs[1]):,} runs in {SOAK_S} s, {edges[-1]} edges, nothing found")
