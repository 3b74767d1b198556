# `make run` starts the robot with the emulator, `make test` runs all checks and tests.
# `make bench` measures accuracy and timing, `make soak` runs the long forms of the tests.

PYTHON ?= python3.11
VENV   := .venv
BIN    := $(VENV)/bin
PIP    := $(BIN)/python -m pip install -q --disable-pip-version-check

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

# Kernels are tested compiled, and again as plain Python, because coverage cannot trace compiled code. Tests that depend
# on the wall clock run last, two at a time, with no other load.
tests: $(VENV)/test.stamp
	$(BIN)/python -m pytest -q -n auto -m "(kernels or compiled) and not realtime and not soak"
	$(BIN)/python -m pytest -q -n auto -m "not (kernels or compiled) and not realtime and not soak" --cov --cov-report=
	NUMBA_DISABLE_JIT=1 $(BIN)/python -m pytest -q -n auto -m "kernels and not realtime and not compiled and not soak" \
		--cov --cov-append --cov-report=term:skip-covered --cov-fail-under=90
	$(BIN)/python -m pytest -q -n 2 -m "realtime and not soak"

# Compiled code does not check array bounds by default; this run does.
boundscheck: $(VENV)/test.stamp
	NUMBA_BOUNDSCHECK=1 NUMBA_CACHE_DIR=$(VENV)/kernels-boundscheck $(BIN)/python -m pytest -q -n auto -m "not realtime and not compiled and not soak" \
		tests/perception tests/drivers/emulator tests/drivers/denning/test_device.py

# Measures every promise and writes docs/promises.md. (The option needs its "=": pytest would take the page for a test.)
promises: $(VENV)/test.stamp
	$(BIN)/python -m pytest -q -m "promise and not soak" --promises=docs/promises.md

# Long forms of tests, fuzzers, new random examples (`make tests` repeats the same ones), and 1.5 h of driving in virtual
# time that checks memory growth, late compilation and full garbage collections.
soak: $(VENV)/soak.stamp
	$(BIN)/python -m pytest -q -m hypothesis --hypothesis-profile=explore
	$(BIN)/python -m pytest -m soak --promises=docs/promises-soak.md
	@$(BIN)/python -m bench.growth $(SOAK)
	@$(BIN)/python -m bench.budget $(SOAK)

# Changes the code in one place at a time, checks that the tests detect it, and writes docs/mutants.md.
mutants: $(VENV)/test.stamp
	NUMBA_DISABLE_JIT=1 $(BIN)/python -m tests.mutation.campaign

# Compares our methods with libraries, then measures timing; at last pytest checks what depends on the wall clock.
# BENCH=--quick shortens the comparison, TIMING="--against earlier.json" adds the figures of an earlier run.
bench: $(VENV)/bench.stamp
	@$(BIN)/python -m bench $(BENCH)
	@$(BIN)/python -m bench timing $(TIMING)
	@$(BIN)/python -m bench waking
	@$(BIN)/python -m bench recording
	@$(BIN)/python -m bench console
	$(BIN)/python -m pytest -q bench/wallclock

clean:
	rm -rf $(VENV) build *.egg-info .mypy_cache .pytest_cache .ruff_cache .hypothesis .coverage .import_linter_cache

$(VENV)/bin/python:
	@command -v $(PYTHON) >/dev/null || { echo "make: $(PYTHON) not found: install it, or choose another: make PYTHON=python3.12"; exit 1; }
	@$(PYTHON) -c "import ensurepip" 2>/dev/null || { echo "installing $(PYTHON)-venv, which Debian's Python needs for virtual environments"; \
		$$([ $$(id -u) = 0 ] || echo sudo) sh -c "apt-get -qq update && apt-get -qq install -y $(PYTHON)-venv"; }
	$(PYTHON) -m venv $(VENV)

$(VENV)/run.stamp: pyproject.toml | $(VENV)/bin/python
	$(PIP) --editable .
	@touch $@

# The console's page is tested in Debian's browser.
$(VENV)/browser.stamp: | $(VENV)/bin/python
	@command -v chromium >/dev/null || { echo "installing chromium for the tests of the console's page"; \
		$$([ $$(id -u) = 0 ] || echo sudo) sh -c "apt-get -qq update && apt-get -qq install -y chromium"; }
	@touch $@

$(VENV)/test.stamp: pyproject.toml | $(VENV)/bin/python $(VENV)/browser.stamp
	$(PIP) --editable ".[dev]"
	@touch $@

$(VENV)/soak.stamp: pyproject.toml | $(VENV)/bin/python
	$(PIP) --editable ".[dev,fuzz]"
	@touch $@

$(VENV)/bench.stamp: pyproject.toml | $(VENV)/bin/python
	$(PIP) --editable ".[dev,bench]"
	@touch $@
