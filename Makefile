# `make run` starts the robot with the emulator, `make test` runs all checks and tests, `make check` the quick ones.
# `make bench` measures accuracy and timing, `make soak` runs the long forms of the tests, `make docs` builds the site.

PYTHONS := python3.11 python3.12 python3.13
ifndef PYTHON
PYTHON := $(firstword $(foreach one,$(PYTHONS),$(if $(shell command -v $(one)),$(one))) python3.11)
endif
VENV   := .venv
BIN    := $(VENV)/bin
UV     := $(shell command -v uv)
COMMA  := ,
PYTEST := $(BIN)/python -m pytest -q
PROCESSORS = $(shell nproc)
LINES  := $(VENV)/lines
NPM_BIN := $(VENV)/npm/node_modules/.bin
# mypy looks for garbage after each 200,000 objects, which takes a quarter of its processor time (18 of 66 s); after each
# 4 million it takes 6 s, and a third more memory (1.1 GB).
MYPY = $(BIN)/python -c "import gc; gc.set_threshold(4_000_000, 30, 30); gc.set_threshold = lambda *_: None; \
	from mypy.__main__ import console_entry; console_entry()"
KERNELS = tests/perception tests/behaviors/valley tests/drivers/emulator
BOUNDSCHECKED = $(sort $(shell grep -rl --include='test_*.py' 'mark\.bounds' tests))

# Python's compiled modules are kept whatever the environment says: a start without them takes twice the processor time.
unexport PYTHONDONTWRITEBYTECODE
# As pip does; a company's registry may have a certificate of its own.
export UV_SYSTEM_CERTS ?= 1

.PHONY: run test beside check lint kernels tests compiled interpreted coverage boundscheck promises mutants soak ros2 bench docs clean

run: $(VENV)/run.stamp
	@$(BIN)/echolocate run

# All at once, so that no processor waits while something is fetched, or one of them collects its tests. What runs beside
# has a lower priority: the others begin with compiling in one process, and later leave gaps, as they wait for the clock.
test:
	@$(MAKE) --no-print-directory --silent --jobs=3 $(VENV)/test.stamp $(VENV)/npm.stamp $(VENV)/browser.stamp
	@$(MAKE) --no-print-directory --jobs=3 compiled beside
	@$(MAKE) --no-print-directory coverage

beside: $(VENV)/test.stamp
	@nice -n 5 $(MAKE) --no-print-directory --output-sync=target boundscheck lint interpreted

# What answers within a minute while one edits: lint, types, and the tests of what changed since the last commit.
check: lint
	$(BIN)/python -m tests.changed

lint: $(VENV)/test.stamp $(VENV)/npm.stamp
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(MYPY)
	$(BIN)/lint-imports
	$(BIN)/codespell
	@if [ -x $(NPM_BIN)/tsc ]; then $(NPM_BIN)/biome ci --colors=off --config-path=.ci/page runtime/console/page \
		&& $(NPM_BIN)/tsc --project .ci/page; \
		else echo "without npm's packages the console's page is not checked"; fi

kernels: $(VENV)/test.stamp
	$(BIN)/python -m tests.compile_kernels

tests: compiled interpreted
	@$(MAKE) --no-print-directory coverage

# All tests but those of `boundscheck`, and of `interpreted` alone (tests/inner_kernels.py). Many wait for the clock, so
# there are twice as many at a time as processors.
compiled: $(VENV)/test.stamp $(VENV)/npm.stamp $(VENV)/browser.stamp
	@rm -f $(LINES)/compiled-*
	LINE_COVERAGE=$(LINES) $(PYTEST) --forks $$((2 * $(PROCESSORS))) -m "not soak and not boundscheck"

# Kernels again as plain Python: coverage cannot see into compiled code.
interpreted: $(VENV)/test.stamp
	@rm -f $(LINES)/interpreted-*
	LINE_COVERAGE=$(LINES) NUMBA_DISABLE_JIT=1 $(PYTEST) --forks $(PROCESSORS) $(KERNELS) \
		-m "kernels and not compiled and not covered and not realtime and not soak"

# The lines that neither of the two has executed.
coverage: $(VENV)/test.stamp
	$(BIN)/python -m slipcover --merge $(LINES)/*.json --out $(VENV)/lines.json --skip-covered --fail-under 95

# Drives and damaged states with array bounds checked, which compiled code does not do by default. Each kernel is compiled
# for it and called little, so it is optimised less. Kernels of places, grids, surfaces and the paper's method are checked
# so by `make soak` alone; what `make interpreted` runs is checked, too, as Python checks indices.
boundscheck: $(VENV)/test.stamp
	NUMBA_BOUNDSCHECK=1 NUMBA_OPT=1 $(PYTEST) $(BOUNDSCHECKED) -m "boundscheck and not soak"

# Measures every promise and writes docs/promises.md. (The option needs its "=": pytest would take the page for a test.)
promises: $(VENV)/test.stamp $(VENV)/npm.stamp $(VENV)/browser.stamp
	$(BIN)/python -m pytest -q -m "promise and not soak" --promises=docs/promises.md

# Long forms of tests, fuzzers, new random examples (`make tests` repeats the same ones), and 1.5 h of driving in virtual
# time that checks memory growth, late compilation and full garbage collections.
soak: $(VENV)/soak.stamp $(VENV)/browser.stamp ros2
	$(BIN)/python -m pytest -q -m hypothesis --hypothesis-profile=explore
	NUMBA_BOUNDSCHECK=1 $(PYTEST) $(BOUNDSCHECKED) -m "boundslong or boundscheck and soak"
	$(BIN)/python -m pytest -m "soak and not ros2" --promises=docs/promises-soak.md
	@$(BIN)/python -m bench.growth $(SOAK)
	@$(BIN)/python -m bench.budget $(SOAK)

# The bridge to ROS 2 beside real nodes. ROS is 260 MB and starts every Python of its environment anew, so it has its own.
ros2: $(VENV)-ros2/stamp
	$(VENV)-ros2/bin/python -m pytest -m ros2 --promises=docs/promises-soak.md

$(VENV)-ros2/stamp: pyproject.toml
	$(PYTHON) -m venv $(VENV)-ros2
	$(VENV)-ros2/bin/python -m pip install -q --disable-pip-version-check --editable ".[dev,ros2]"
	@touch $@

# Changes the code in one place at a time, checks that the tests detect it, and writes docs/mutants.md.
mutants: $(VENV)/test.stamp
	NUMBA_DISABLE_JIT=1 $(BIN)/python -m tests.mutation.campaign

# Compares our methods with libraries, then measures timing; at last pytest checks what depends on the wall clock.
# BENCH=--quick shortens the comparison, TIMING="--against earlier.json" adds the figures of an earlier run. What the
# result files hold enters docs/figures.md.
bench: $(VENV)/bench.stamp $(VENV)/browser.stamp
	@$(BIN)/python -m bench $(BENCH)
	@$(BIN)/python -m bench timing $(TIMING)
	@$(BIN)/python -m bench waking
	@$(BIN)/python -m bench localization --first 20000
	@$(BIN)/python -m bench map
	@$(BIN)/python -m bench walls --seeds 10
	@$(BIN)/python -m bench recording
	@$(BIN)/python -m bench console
	$(BIN)/python -m pytest -q bench/wallclock
	@$(BIN)/python -m bench figures --results .

# The documentation as a site in build/site; a link that leads nowhere is an error.
docs: $(VENV)/docs.stamp
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --quiet

clean:
	rm -rf $(VENV) $(VENV)-ros2 build *.egg-info .mypy_cache .pytest_cache .ruff_cache .hypothesis .coverage .import_linter_cache

# uv takes a third of pip's time. Where it is not installed, pip fetches it; where that fails, pip installs everything.
define install
	@echo "installing echolocate and its dependencies into $(VENV)"; \
	uv=$(or $(UV),$(BIN)/uv); \
	[ -x "$$uv" ] || $(BIN)/python -m pip install -q --disable-pip-version-check uv || true; \
	{ [ -x "$$uv" ] && "$$uv" pip install -q --compile-bytecode --python $(BIN)/python --editable "$(1)"; } \
		|| $(BIN)/python -m pip install -q --disable-pip-version-check --editable "$(1)"
	@touch $@
endef

# With uv where it is installed, which also finds or fetches the Python.
$(VENV)/bin/python:
ifneq ($(UV),)
	@echo "using $(PYTHON) of those that uv finds or fetches"
	uv venv -q --python $(PYTHON) $(VENV)
else
	@command -v $(PYTHON) >/dev/null || { echo "make: $(PYTHON) not found, nor another of $(PYTHONS): install one of them, or name one: make PYTHON=/path/to/python3"; exit 1; }
	@$(PYTHON) -c "import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 14))" || { echo "make: $$($(PYTHON) --version) does not do: echolocate needs Python 3.11, 3.12 or 3.13; make PYTHON=/path/to/one"; exit 1; }
	@echo "using $$($(PYTHON) --version) at $$(command -v $(PYTHON))"
	@$(PYTHON) -c "import ensurepip" 2>/dev/null || { echo "installing $(PYTHON)-venv, which Debian's Python needs for virtual environments"; \
		$$([ $$(id -u) = 0 ] || echo sudo) sh -c "apt-get -qq update && apt-get -qq install -y $(PYTHON)-venv"; }
	$(PYTHON) -m venv $(VENV)
endif

$(VENV)/run.stamp: pyproject.toml | $(VENV)/bin/python
	$(call install,.)

# The console's page is tested in Debian's browser.
$(VENV)/browser.stamp: | $(VENV)/bin/python
	@command -v chromium-headless-shell >/dev/null || command -v chromium >/dev/null || { \
		echo "installing chromium for the tests of the console's page"; \
		$$([ $$(id -u) = 0 ] || echo sudo) sh -c "apt-get -qq update && \
			{ apt-get -qq install -y chromium-headless-shell || apt-get -qq install -y chromium; }"; }
	@touch $@

# What checks the page, and the reader of recordings that Foxglove and Lichtblick use, at the locked versions.
$(VENV)/npm.stamp: .ci/page/package-lock.json | $(VENV)/bin/python
	@mkdir -p $(VENV)/npm && cp .ci/page/package.json .ci/page/package-lock.json $(VENV)/npm
	@{ command -v npm >/dev/null && npm ci --silent --no-audit --no-fund --prefix $(VENV)/npm; } \
		|| echo "npm is not installed, or reaches no registry: what needs its packages is skipped"
	@touch $@

$(VENV)/test.stamp: pyproject.toml | $(VENV)/bin/python
	$(call install,.[dev])

$(VENV)/soak.stamp: pyproject.toml | $(VENV)/bin/python
	$(call install,.[dev$(COMMA)fuzz$(COMMA)tune])

$(VENV)/bench.stamp: pyproject.toml | $(VENV)/bin/python
	$(call install,.[dev$(COMMA)bench])

$(VENV)/docs.stamp: pyproject.toml | $(VENV)/bin/python
	$(call install,.[docs])
