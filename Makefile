PYTHON ?= python3
BIN := .venv/bin
STAMP := .venv/.installed

.DEFAULT_GOAL := help
.PHONY: help setup demo test test-long check format docs bench bench-long clean

help:  ## list the targets
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed 's/:.*## /\t/' | expand -t 14

setup: $(STAMP)  ## create .venv with the command .venv/bin/brightgrey

$(STAMP): pyproject.toml
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "brightgrey needs Python 3.11 or newer, this is " + sys.version)'
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@touch $@

demo: setup  ## identify the drive of the recording that ships with the package, results in demo/
	$(BIN)/brightgrey demo --out demo

test: setup  ## all tests that take less than minutes
	$(BIN)/python -m pytest -q -n 2

test-long: setup  ## the tests that take minutes
	$(BIN)/python -m pytest -q -n 2 -m long

check: setup  ## lint, types, import contract
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache

format: setup  ## mend what the linter can mend
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

docs: setup  ## the documentation in docs/build/html, strict, its examples executed
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[docs]'
	PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/python -m sphinx -W --keep-going -q -b html docs docs/build/html

bench: setup  ## speed and accuracy, as ratios measured in one run
	$(BIN)/python bench/speed.py
	$(BIN)/python bench/genetic.py speed
	$(BIN)/python bench/identification.py
	$(BIN)/python bench/runs.py

bench-long: setup  ## the statistics of docs/results.md
	$(BIN)/python bench/accuracy.py
	$(BIN)/python bench/global_optimum.py
	$(BIN)/python bench/coverage.py
	$(BIN)/python bench/real_recordings.py
	$(BIN)/python bench/recovery.py run 0 200
	$(BIN)/python bench/recovery.py table
	$(BIN)/python bench/symptoms.py false --runs 60 --seed 101
	$(BIN)/python bench/symptoms.py missing --runs 8
	$(BIN)/python bench/genetic.py rates paper reference 0 100
	$(BIN)/python bench/genetic.py rates tuned reference 0 100
	$(BIN)/python bench/genetic.py rates paper others 0 20
	$(BIN)/python bench/genetic.py rates tuned others 0 100
	$(BIN)/python bench/genetic.py table

clean:  ## remove what the targets above have made
	rm -rf .venv demo docs/build .pytest_cache .mypy_cache .ruff_cache .hypothesis
