# Two commands matter: `make run` starts the robot in the emulator, `make test` proves that it works.
# `make bench` measures it against what one would use instead, `make soak` runs the long forms of the tests.

PYTHON ?= python3.11
VENV   := .venv
BIN    := $(VENV)/bin
PIP    := $(BIN)/python -m pip install --quiet --disable-pip-version-check

.PHONY: run test lint tests boundscheck promises mutants soak bench clean

run: $(VENV)/run.stamp
	@$(BIN)/echolocate run

test: lint tests boundscheck

lint: $(VENV)/test.stamp
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/codespell

# Kernels are tested compiled, and once more as plain Python: only so does coverage see into them. What watches the clock
# mostly waits: two of a kind, and nothing beside them.
tests: $(VENV)/test.stamp
	$(BIN)/python -m pytest -q -n auto -m "(kernels or compiled) and not realtime and not soak"
	$(BIN)/python -m pytest -q -n auto -m "not (kernels or compiled) and not realtime and not soak" --cov --cov-report=
	NUMBA_DISABLE_JIT=1 $(BIN)/python -m pytest -q -n auto -m "kernels and not realtime and not compiled and not soak" \
		--cov --cov-append --cov-report=term:skip-covered --cov-fail-under=90
	$(BIN)/python -m pytest -q -n 2 -m "realtime and not soak"

# Compiled code reads beyond an array in silence; this run does not let it.
boundscheck: $(VENV)/test.stamp
	NUMBA_BOUNDSCHECK=1 NUMBA_CACHE_DIR=$(VENV)/kernels-boundscheck $(BIN)/python -m pytest -q -n auto -m "not realtime and not compiled and not soak" \
		tests/perception tests/drivers/emulator/test_acoustics.py tests/drivers/test_emulator*.py

# What is promised, measured again: writes docs/promises.md. (With a blank for the =, pytest takes the page for a test.)
promises: $(VENV)/test.stamp
	$(BIN)/python -m pytest -q -m "promise and not soak" --promises=docs/promises.md

# The long forms, the fuzzers, and an hour and a half of driving in virtual time: does anything grow, compile late, or
# collect all garbage? And generated examples that no run had before; `make tests` has the same ones every time.
soak: $(VENV)/soak.stamp
	$(BIN)/python -m pytest -q -m hypothesis --hypothesis-profile=explore
	$(BIN)/python -m pytest -m soak --promises=docs/promises-soak.md
	@$(BIN)/python -m bench.growth $(SOAK)
	@$(BIN)/python -m bench.budget $(SOAK)

# Small lies put into the code, and whether the tests notice: writes docs/mutants.md.
mutants: $(VENV)/test.stamp
	NUMBA_DISABLE_JIT=1 $(BIN)/python -m tests.mutation.campaign

# Ours against the libraries one would use instead, and against the clock; BENCH=--quick for a small run of the first,
# TIMING="--against earlier.json" for a comparison.
bench: $(VENV)/bench.stamp
	@$(BIN)/python -m bench $(BENCH)
	@$(BIN)/python -m bench timing $(TIMING)
	@$(BIN)/python -m bench waking
	@$(BIN)/python -m bench recording
	@$(BIN)/python -m bench console

clean:
	rm -rf $(VENV) build *.egg-info .mypy_cache .pytest_cache .ruff_cache .hypothesis .coverage .import_linter_cache

$(VENV)/bin/python:
	@command -v $(PYTHON) >/dev/null || { echo "make: $(PYTHON) is not here; install it, or name another: make PYTHON=python3.12"; exit 1; }
	@$(PYTHON) -c "import ensurepip" 2>/dev/null || { echo "installing $(PYTHON)-venv, without which Debian's Python makes no environments"; \
		$$([ $$(id -u) = 0 ] || echo sudo) sh -c "apt-get -qq update && apt-get -qq install -y $(PYTHON)-venv"; }
	$(PYTHON) -m venv $(VENV)

$(VENV)/run.stamp: pyproject.toml | $(VENV)/bin/python
	$(PIP) --editable .
	@touch $@

# The page of the console is tested in a browser: Debian's.
$(VENV)/browser.stamp: | $(VENV)/bin/python
	@command -v chromium >/dev/null || { echo "installing chromium, in which the console's page is tested"; \
		$$([ $$(id -u) = 0 ] || echo sudo) sh -c "apt-get -qq update && apt-get -qq install -y chromium"; }
	@touch $@

$(VENV)/test.stamp: pyproject.toml | $(VENV)/bin/python $(VENV)/browser.stamp
	$(PIP) --editable ".[dev]"
	@touch $@

$(VENV)/soak.stamp: pyproject.toml | $(VENV)/bin/python
	$(PIP) --editable ".[dev,fuzz]"
	@touch $@

$(VENV)/bench.stamp: pyproject.toml | $(VENV)/bin/python
	$(PIP) --editable ".[bench]"
	@touch $@
