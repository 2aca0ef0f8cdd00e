# Evenhand. `make` alone says what there is.
SHELL := /bin/bash
.DEFAULT_GOAL := help
.PHONY: help reproduce test long check bench docs sb3 lock clean

BIN := .venv/bin
# The environment with everything in it, and the last of the pages that are built with it.
INSTALLED := .venv/.ready
READY := src/evenhand/study/server/static/study.js
OUT ?= out/reproduce
# What is installed; dev,sb3 has all that any test wants, and takes 5 GB more.
EXTRAS ?= dev
# Anything else for the command: make reproduce ARGS="--seeds 2"
ARGS ?=

# uv installs and compiles on all cores; pip, which is slower, also knows mirrors that only its own
# configuration names.
install = $(BIN)/uv pip install --quiet --python $(BIN)/python --compile-bytecode \
		--constraint constraints.txt --editable $(1) \
	|| $(BIN)/pip install --quiet --disable-pip-version-check \
		--constraint constraints.txt --editable $(1)

# The first Python that is new enough and can make environments.
PYTHON ?= $(shell for p in python3.11 python3 python3.12 python3.13 python3.14; do \
	$$p -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))' 2>/dev/null \
	&& { echo $$p; break; }; done)

help: ## say what there is
	@sed -nE 's/^([a-z0-9]+):[^#]*## (.*)/make \1\t\2/p' Makefile | expand -t 18

reproduce: $(READY) ## run the whole experiment of the paper and write its report (OUT=, ARGS=)
	$(BIN)/evenhand reproduce --out $(OUT) $(ARGS)
	@echo "report: $(abspath $(OUT))/report.html"

test: $(READY) ## run the tests (ARGS= for pytest)
	$(BIN)/pytest -n 2 --ignore=tests/integrations --ignore=tests/browser $(ARGS)

long: $(READY) ## tests that CI has no time for: sweeps, a Ray cluster, twenty kills
	$(BIN)/pytest tests/integrations -m long $(ARGS)

check: $(READY) ## format, lint, types, imports, spelling, house rules
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	PYRIGHT_PYTHON_IGNORE_WARNINGS=1 $(BIN)/pyright
	$(BIN)/lint-imports
	$(BIN)/codespell
	$(BIN)/pytest -q tests/contracts/test_house.py

bench: $(READY) ## measure speed, side by side; beside Stable-Baselines3 after make sb3 (ARGS=--json)
	$(BIN)/python -m benchmarks $(ARGS)

docs: $(READY) ## build the documentation site, every warning an error
	$(BIN)/sphinx-build -q -W --keep-going -b html docs docs/_build
	@echo "documentation: $(abspath docs/_build)/index.html"

sb3: override EXTRAS = dev,sb3
sb3: $(INSTALLED) ## add Stable-Baselines3 and PyTorch (5 GB), for their tests, example and bench
	$(call install,'.[$(EXTRAS)]')

lock: sb3 ## write the versions of .venv into constraints.txt
	$(BIN)/pip freeze --exclude-editable --exclude evenhand --exclude pip --exclude setuptools \
		> constraints.txt

clean: ## remove .venv, caches and builds; results in out/ stay
	rm -rf docs/_build .venv .hypothesis .import_linter_cache .pytest_cache .ruff_cache build dist \
		frontend/node_modules src/evenhand/restaurant/replay/static src/evenhand/study/server/static
	find src tests -name __pycache__ -prune -exec rm -rf {} +

$(READY): $(INSTALLED) $(shell find frontend -maxdepth 1 -type f) $(shell find frontend/src -type f)
	$(BIN)/python frontend/build.py
	@touch $@

$(INSTALLED): pyproject.toml constraints.txt
	@[ -n "$(PYTHON)" ] || { echo "Evenhand needs Python 3.11 or newer with its venv module:" \
		"install one, or name it with make PYTHON=/path/to/python3.11" >&2; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "$(PYTHON) is" \
		"`$(PYTHON) -V 2>&1`; Evenhand needs Python 3.11 or newer" >&2; exit 1; }
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet --disable-pip-version-check --constraint constraints.txt uv
	$(call install,'.[$(EXTRAS)]')
	@# machine code for this machine, as pip compiles what it installs
	@OMP_NUM_THREADS=1 $(BIN)/python -m evenhand.cli.warm_up
	@touch $@
