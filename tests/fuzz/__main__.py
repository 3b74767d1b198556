"""Coverage-guided fuzzing of one target: `python -m tests.fuzz TARGET SECONDS FOLDER`; needs the extra `fuzz`.

Input that makes a target fail is saved in FOLDER; the traceback goes to stderr and the exit code is not 0.
"""

from __future__ import annotations

import sys
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["drivers", "runtime.recording.ring_log", "cobs", "csv"]):
    from tests.fuzz.targets import SEEDS, TARGETS


def main(target: str, seconds: str, folder: str) -> None:
    """Fuzz for `seconds`; libFuzzer ends the process."""
    corpus = Path(folder) / "corpus"
    corpus.mkdir(parents=True, exist_ok=True)
    for number, seed in enumerate(SEEDS[target]):
        (corpus / f"seed-{number}").write_bytes(seed)
    options = [f"-max_total_time={seconds}", "-max_len=2048", "-timeout=10", "-rss_limit_mb=500"]
    atheris.Setup([sys.argv[0], *options, f"-artifact_prefix={folder}/", str(corpus)], TARGETS[target])
    atheris.Fuzz()


if __name__ == "__main__":
    main(*sys.argv[1:4])
