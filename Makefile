# Two commands matter: `make run` starts the robot in the emulator, `make test` proves that it works.
# `make bench` measures it against what one would use instead.

PYTHON ?= python3.11
VENV   := .venv
BIN    := $(VENV)/bin
PIP    := $(BIN)/python -m pip install --quiet --disable-pip-version-check

.PHONY: run test lint tests boundscheck coverage bench soak clean

run: $(VENV)/run.stamp
	@$(BIN)/echolocate run

test: lint tests boundscheck coverage

lint: $(VENV)/test.stamp
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

tests: $(VENV)/test.stamp
	$(BIN)/python -m pytest

# Compiled code reads beyond an array in silence; this run does not let it.
boundscheck: $(VENV)/test.stamp
	NUMBA_BOUNDSCHECK=1 NUMBA_CACHE_DIR=$(VENV)/kernels-boundscheck $(BIN)/python -m pytest -q -m "not realtime and not compiled" \
		tests/perception tests/drivers/test_acoustics.py tests/drivers/test_emulator.py

# Coverage sees into kernels only where they are not compiled.
coverage: $(VENV)/test.stamp
	NUMBA_DISABLE_JIT=1 $(BIN)/python -m coverage run -m pytest -q -m "not realtime and not compiled"
	$(BIN)/python -m coverage report --skip-covered --fail-under=90

# Ours against the libraries one would use instead, and against the clock; BENCH=--quick for a small run of the first,
# TIMING="--against earlier.json" for a comparison.
bench: $(VENV)/bench.stamp
	@$(BIN)/python -m tests.bench $(BENCH)
	@$(BIN)/python -m tests.bench timing $(TIMING)
	@$(BIN)/python -m tests.bench waking

# An hour and a half of driving in virtual time: does anything grow, compile late, or collect all garbage?
# And generated examples that no run had before; `make tests` has the same ones every time.
soak: $(VENV)/test.stamp
	$(BIN)/python -m pytest -q -m hypothesis --hypothesis-profile=explore
	@$(BIN)/python -m tests.timing.growth $(SOAK)

clean:
	rm -rf $(VENV) build *.egg-info .mypy_cache .pytest_cache .ruff_cache .hypothesis .coverage

$(VENV)/bin/python:
	@command -v $(PYTHON) >/dev/null || { echo "make: $(PYTHON) is not here; install it, or name another: make PYTHON=python3.12"; exit 1; }
	@$(PYTHON) -c "import ensurepip" 2>/dev/null || { echo "installing $(PYTHON)-venv, without which Debian's Python makes no environments"; \
		$$([ $$(id -u) = 0 ] || echo sudo) sh -c "apt-get -qq update && apt-get -qq install -y $(PYTHON)-venv"; }
	$(PYTHON) -m venv $(VENV)

$(VENV)/run.stamp: pyproject.toml | $(VENV)/bin/python
	$(PIP) --editable .
	@touch $@

$(VENV)/test.stamp: pyproject.toml | $(VENV)/bin/python
	$(PIP) --editable ".[dev]"
	@touch $@

$(VENV)/bench.stamp: pyproject.toml | $(VENV)/bin/python
	$(PIP) --editable ".[bench]"
	@touch $@
