# Everything here needs only make and a Python from 3.11 to 3.13. Choose another with: make setup PYTHON=/path/to/python3
# The environment lives in .venv and is reused until pyproject.toml or requirements.lock changes.
.DEFAULT_GOAL := help
.PHONY: help setup reproduce test run-tests test-processors test-lowest test-newest torture lint style layers types format docs renew package bench lock clean
.DELETE_ON_ERROR:

VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --quiet --disable-pip-version-check --no-input
UV := $(BIN)/uv
LOCK := requirements.lock
LOCK_BENCH := requirements-bench.lock
RUNTIME := $(VENV)/.runtime-installed
DEV := $(VENV)/.dev-installed
BENCH := $(VENV)/.bench-installed
# Test processes at once, each with one thread for linear algebra, as more would stand in each other's way; a third
# process costs more (it compiles everything once more) than it saves. Threads of numba that have nothing to do sleep: by
# default they wait actively, and take the other processes' time.
JOBS ?= 2
ALONGSIDE := OPENBLAS_NUM_THREADS=1 OMP_WAIT_POLICY=passive
# What is imported is compiled once, also where the environment lets Python write no bytecode: tests start many processes.
export PYTHONDONTWRITEBYTECODE :=

# Makes .venv with the first suitable Python, unless a working one is there.
define make_venv
	@if ! $(BIN)/python -m pip --version >/dev/null 2>&1; then \
	  for candidate in $(if $(PYTHON),"$(PYTHON)",python3.13 python3.12 python3.11 python3 python); do \
	    if "$$candidate" -c 'import sys, venv, ensurepip; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))' \
	        >/dev/null 2>&1; then found="$$candidate"; break; fi; \
	  done; \
	  if [ -z "$$found" ]; then \
	    echo "make: no Python 3.11, 3.12 or 3.13 with venv and ensurepip$(if $(PYTHON), at $(PYTHON)); set PYTHON=" >&2; \
	    exit 1; \
	  fi; \
	  echo "Creating $(VENV) with $$found ($$("$$found" --version 2>&1))"; \
	  rm -rf $(VENV); \
	  "$$found" -m venv $(VENV) || exit 1; \
	fi
endef

help:  ## list the targets
	@sed -n 's/^\([a-z-]*\):[^#]*## \(.*\)/  make \1\t\2/p' Makefile | expand -t 26

setup: $(DEV)  ## make .venv with everything that the tests need

# uv installs in a third of pip's time; where it cannot be had or fails, pip does the same.
define install
	@$(PIP) install -c $(LOCK) setuptools
	@{ $(PIP) install uv && UV_HTTP_TIMEOUT=20 $(UV) pip install --quiet --python $(BIN)/python -c $(LOCK) \
	    --no-build-isolation -e '$(1)'; } >/dev/null 2>&1 || $(PIP) install -c $(LOCK) --no-build-isolation -e '$(1)'
endef

$(RUNTIME): pyproject.toml $(LOCK)
	$(make_venv)
	@echo "Installing chilopod and what it runs on"
	$(call install,.)
	@touch $@

$(DEV): pyproject.toml $(LOCK)
	$(make_venv)
	@echo "Installing chilopod, what it runs on and what its tests need"
	$(call install,.[dev])
	@touch $(RUNTIME) $@

$(BENCH): $(RUNTIME) $(LOCK_BENCH)
	@echo "Installing the peers of the benchmarks"
	@$(PIP) install -c $(LOCK) -r $(LOCK_BENCH)
	@touch $@

reproduce: $(RUNTIME)  ## compute the paper's results and write report/index.html; options in ARGS="--quick"
	$(BIN)/chilopod reproduce $(ARGS)

test: style  ## all checks and all tests
	@$(MAKE) --no-print-directory -j 2 run-tests layers types

run-tests: $(DEV)
	$(ALONGSIDE) $(BIN)/python -m pytest -n $(JOBS) --dist loadfile --no-loadscope-reorder --benchmark-disable $(ARGS)

# OpenBLAS does not look whether the processor has what its kernels need.
KERNELS ?= Haswell Zen Nehalem $(shell grep -qs avx512vl /proc/cpuinfo && echo SkylakeX)
NUMERIC := tests/flows tests/stability tests/truth tests/analysis tests/planar tests/tasks tests/test_examples.py

test-processors: $(DEV)  ## the numeric tests with the arithmetic of other processors; half an hour; some in KERNELS="Zen"
	@failed=; for kernel in $(KERNELS); do \
	  echo "OpenBLAS kernels: $$kernel"; \
	  OPENBLAS_CORETYPE=$$kernel $(MAKE) --no-print-directory run-tests ARGS="$(NUMERIC)" || failed="$$failed $$kernel"; \
	done; \
	echo "compiled for a generic processor: no FMA, no AVX"; \
	NUMBA_CPU_NAME=generic $(MAKE) --no-print-directory run-tests ARGS="$(NUMERIC)" || failed="$$failed generic"; \
	if [ -n "$$failed" ]; then echo "failed:$$failed" >&2; exit 1; fi

# The core of the suite with other versions than the lock's, in an environment of its own. What has wheels counts; what
# an old version does that is deprecated by now is its own affair.
CORE := $(addprefix tests/,engine gym live paper/page planar show trials truth/test_duffing.py truth/test_hybrid.py twin) \
	$(wildcard tests/test_cli_*.py) $(addprefix tests/test_,compiled.py dual.py integrate.py lanes.py notebook.py \
	numba_internals.py output.py package.py record_file.py)
OTHERS = $(VENV)-$(@:test-%=%)
define test_core
	@$(UV) venv --quiet --clear --no-python-downloads --python "$(or $(PYTHON),$(BIN)/python)" $(OTHERS)
	@$(UV) pip install --quiet --no-config --python $(OTHERS) --only-binary :all: --no-binary chilopod $(1) -e '.[dev]'
	$(ALONGSIDE) $(OTHERS)/bin/python -m pytest -n $(JOBS) --dist loadfile --benchmark-disable $(2) $(CORE) $(ARGS)
endef

test-lowest: $(UV)  ## the core of the tests with the lowest versions that pyproject.toml allows; PYTHON=python3.11
	$(call test_core,--resolution lowest-direct,-W ignore::DeprecationWarning -W ignore::FutureWarning)

test-newest: $(UV)  ## the same with the newest that there are
	$(call test_core,--upgrade,)

torture: $(DEV)  ## attack it for ten minutes, and count what came of it; options in ARGS="kills --seed 7 --minutes 3"
	$(BIN)/python torture/run.py --save $(ARGS)

lint: style layers  ## style and the contracts between layers

style: $(DEV)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

layers: $(DEV)
	$(BIN)/lint-imports

types: $(DEV)  ## static types
	$(BIN)/mypy

format: $(DEV)  ## rewrite files in the project's style
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

docs: $(DEV)  ## build the documentation with its gallery, build/site/index.html, and check its links
	$(BIN)/python -m sphinx --quiet --fail-on-warning --keep-going -j $(JOBS) -c docs -d build/doctrees . build/site
	$(BIN)/python docs/check.py build/site

renew: $(RUNTIME)  ## run what README and docs show; rewrites its output, numbers and pictures; pages in ARGS=docs/turning.md
	$(BIN)/python docs/renew.py $(ARGS)
	$(if $(ARGS),,$(BIN)/python docs/moving_picture.py)

package: $(DEV)  ## build what is handed out into dist, and try it in an empty environment; some minutes
	rm -rf dist
	$(BIN)/python packaging/build.py dist
	$(BIN)/python packaging/try_wheel.py dist/*.whl

bench: $(BENCH)  ## benchmarks beside their peers; rewrites the tables in benchmarks/README.md
	$(BIN)/python benchmarks/straight_walk.py
	$(BIN)/python benchmarks/maps.py
	$(BIN)/python benchmarks/periodic_systems.py
	$(BIN)/python benchmarks/simulation.py
	$(BIN)/python benchmarks/stepping.py
	$(BIN)/python benchmarks/series_term.py
	$(BIN)/python benchmarks/twin.py
	$(BIN)/python benchmarks/courses.py
	$(BIN)/python benchmarks/gym.py
	$(BIN)/python benchmarks/startup.py

$(UV):
	$(make_venv)
	@$(PIP) install uv

# One lock for all supported Pythons and systems: no addresses and no hashes, so it also serves as a constraints file.
COMPILE := $(UV) pip compile --quiet --no-config --universal --python-version 3.11 --fork-strategy fewest \
	--upgrade --no-header --no-emit-index-url --no-emit-find-links

lock: $(UV)  ## renew both lock files from pyproject.toml
	@$(COMPILE) --extra dev pyproject.toml >$(LOCK).new
	@{ echo '# Python 3.11 to 3.13, all systems: what chilopod runs on and what its tests need. Written by `make lock`.'; \
	  cat $(LOCK).new; } >$(LOCK)
	@$(COMPILE) --group bench -c $(LOCK) >$(LOCK_BENCH).new
	@{ echo '# The peers of the benchmarks, on top of requirements.lock. Written by `make lock`.'; \
	  cat $(LOCK_BENCH).new; } >$(LOCK_BENCH)
	@rm -f $(LOCK).new $(LOCK_BENCH).new

clean:  ## remove the environment, caches and generated output
	rm -rf $(VENV) $(VENV)-lowest $(VENV)-newest build dist report .pytest_cache .mypy_cache .ruff_cache .hypothesis .benchmarks \
	  .import_linter_cache src/*.egg-info docs/gallery docs/reference
	find src tests benchmarks -name __pycache__ -type d -prune -exec rm -rf {} + 2>/dev/null || true
