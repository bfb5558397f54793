# polhode: `make bench` and `make test` set everything up by themselves.
# `make help` lists the commands; PYTHON=/path/to/python3.12 chooses the interpreter.

VENV   := .venv
BIN    := $(VENV)/bin
READY  := $(VENV)/.ready
# The loader of the tests and of the bench never competes with BLAS threads.
export OMP_NUM_THREADS := 1
export OPENBLAS_NUM_THREADS := 1
export NUMBA_NUM_THREADS := 1

BEFORE ?= HEAD~1
AFTER  ?= HEAD
SEED    ?= 1
MINUTES ?= 20

.DEFAULT_GOAL := help
.PHONY: help setup bench test test-all test-versions check hashes lint format docs benchmark benchmark-compare cold-start torture report everything clean

help: ## list the commands
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-18s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

setup: $(READY) ## create the virtual environment and install polhode into it

$(READY): pyproject.toml setup.py requirements.txt bootstrap.sh
	@sh bootstrap.sh $(VENV)
	@touch $@

bench: $(READY) ## the main job: cost against accuracy as St grows, into reports/bench/
	$(BIN)/polhode bench

test: lint ## the checks and the tests; types are checked beside the tests
	@$(MAKE) --silent build/types & types=$$!; \
	$(BIN)/pytest -m "not slow" --numprocesses 2 --dist worksteal; tests=$$?; \
	wait $$types && exit $$tests

# Half a minute of a processor, spent once for the same files.
build/types: $(READY) $(shell find polhode models solvers harness typings -name '*.py*' -not -name '*.pyc' 2>/dev/null)
	$(BIN)/basedpyright && mkdir -p build && touch $@

test-versions: $(READY) ## the tests under each Python that is found, oldest and newest versions (10 minutes each)
	cd tests && ../$(BIN)/python -m versions $(VERSIONS)

test-all: check ## the checks, then all tests, the slow ones too
	$(BIN)/pytest

benchmark: $(READY) ## forms and solvers under pytest-benchmark, into .benchmarks/ (3 minutes)
	$(BIN)/pytest tests/benchmarks -o python_files='bench_*.py' --benchmark-autosave

torture: $(READY) ## hostile input, kills, bit flips, full disks, races, missing libraries, foreign caches, closed streams: 20 minutes; SEED=2 MINUTES=5, TORTURE_COUNTS=full
	cd tests && ../$(BIN)/python -m torture --seed $(SEED) --minutes $(MINUTES) $(if $(filter full,$(TORTURE_COUNTS)),--full)

cold-start: $(READY) ## commands in processes of their own: wall and processor time
	$(BIN)/python tests/benchmarks/cold_start.py

# The plug-in declared by the installation is today's: each commit's tests load their own.
benchmark-compare: $(READY) ## time two commits in turns (10 minutes): make benchmark-compare BEFORE=HEAD~5 AFTER=HEAD
	@set -e; for commit in $(BEFORE) $(AFTER); do \
	  folder=.benchmarks/$$(git rev-parse --short $$commit); rm -rf $$folder; mkdir -p $$folder/tree; \
	  git archive $$commit | tar -x -C $$folder/tree; \
	done; \
	for round in 1 2; do for commit in $(BEFORE) $(AFTER); do \
	  (cd .benchmarks/$$(git rev-parse --short $$commit)/tree && PYTHONPATH=$$PWD/typings $(CURDIR)/$(BIN)/python \
	    -m pytest -q -p no:polhode tests/benchmarks -o python_files='bench_*.py' -p no:cacheprovider --benchmark-json=../$$round.json); \
	done; done
	$(BIN)/polhode compare .benchmarks/$$(git rev-parse --short $(BEFORE)) .benchmarks/$$(git rev-parse --short $(AFTER))

docs: report ## the same as report

report: $(READY) ## one offline site of documentation, API and reports, into reports/site/
	$(BIN)/polhode report

# Lines of reports/commands.txt are commands of polhode, or programs in docs. Finished ones leave their mark in
# build/everything; the interrupted one is taken up. A command that fails, or misses a target, stops no other: at the
# end make fails, and the next `make everything` runs such commands again. A row of durations.csv is one attempt.
everything: $(READY) ## all that reports/ holds anew: hours of an idle machine; an interrupted run goes on
	@test -d build/everything || rm -f reports/sweep/store.sqlite; mkdir -p build/everything; \
	times=build/everything/durations.csv; test -e $$times || echo command,seconds,exit >$$times; \
	while read -r line; do \
	  mark=build/everything/$$(echo "$$line" | tr ' /' '__'); test -e "$$mark.done" && continue; \
	  case "$$line" in docs/*|tests/*) run="$(BIN)/python $$line";; *) run="$(BIN)/polhode $$line";; esac; \
	  if test -e "$$mark.begun" && $(BIN)/polhode $${line%% *} --help 2>/dev/null | grep -q -e --resume; then run="$$run --resume"; fi; \
	  touch "$$mark.begun"; echo "$$run"; began=$$(date +%s); $$run </dev/null; code=$$?; \
	  echo "$$line,$$(($$(date +%s) - began)),$$code" >>$$times; \
	  test $$code -gt 128 && exit $$code; \
	  if test $$code = 0; then mv "$$mark.begun" "$$mark.done"; \
	  else echo "$$run: exit code $$code" >&2; failed=yes; fi; \
	done <reports/commands.txt; test -z "$$failed" && rm -r build/everything

hashes: ## requirements.txt anew: what `make setup` installs, as constraints.txt says, with hashes
	$(BIN)/uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-annotate --no-header \
	  --constraint constraints.txt --extra site --extra dask --extra dev pyproject.toml --output-file requirements.txt

check: lint ## format, lint, direction of imports, types
	$(BIN)/basedpyright

lint: $(READY)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	cd typings && PYTHONPATH=. ../$(BIN)/lint-imports --config ../pyproject.toml --no-cache

format: $(READY) ## format the code
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

clean: ## remove the virtual environment and caches
	rm -rf $(VENV) .pytest_cache .ruff_cache .hypothesis .benchmarks *.egg-info
