PYTHON ?= python3
BIN := .venv/bin
# Without compilation of all that is installed: what is used is compiled when it is used first.
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile --editable
# What is installed: the package alone, with the app, or with all that development takes.
PACKAGE := .venv/.package
WITH_APP := .venv/.app
FOR_DEVELOPMENT := .venv/.development

.DEFAULT_GOAL := help
.PHONY: help setup app demo test test-system test-long check format docs bench bench-long validation pictures gallery clean

help:  ## list the targets
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed 's/:.*## /\t/' | expand -t 14

setup: $(FOR_DEVELOPMENT)  ## create .venv with the command .venv/bin/brightgrey and all that development takes

$(BIN)/python:
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "brightgrey needs Python 3.11 or newer, this is " + sys.version)'
	$(PYTHON) -m venv .venv

$(PACKAGE): pyproject.toml | $(BIN)/python
	$(PIP) .
	@touch $@

$(WITH_APP): pyproject.toml | $(BIN)/python
	$(PIP) '.[app,control,fmu,formats]'
	@touch $(PACKAGE) $@

$(FOR_DEVELOPMENT): pyproject.toml | $(BIN)/python
	$(PIP) '.[dev]'
	@touch $(PACKAGE) $(WITH_APP) $@

app: $(WITH_APP)  ## open the app in the browser, with its workspace in brightgrey-workspace/
	$(BIN)/brightgrey app

demo: $(PACKAGE)  ## identify the drive of the recording that ships with the package, results in demo/
	$(BIN)/brightgrey demo --out demo

test: setup  ## all tests but those of the system and those that take minutes
	$(BIN)/python -m pytest -q -n 2 --dist loadgroup

test-system: setup  ## tests with a browser, other programs, and processes that are killed
	$(BIN)/python -m pytest -q -n 2 --dist loadgroup -m 'system and not long'

test-long: setup  ## the tests that take minutes
	$(BIN)/python -m pytest -q -n 2 -m long

check: setup  ## lint, types, import contracts, form of the house
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache
	$(BIN)/python tools/house.py

format: setup  ## mend what the linter can mend
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

docs: setup  ## the documentation in docs/build/html, strict, its examples executed
	$(PIP) '.[docs]'
	PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/python -m sphinx -W --keep-going -q -b html docs docs/build/html

bench: setup  ## speed, as ratios measured in one run; with SAVE=--save into bench/results/
	$(BIN)/python bench/speed.py $(SAVE)
	$(BIN)/python bench/startup.py $(SAVE)
	$(BIN)/python bench/genetic.py $(SAVE) speed
	$(BIN)/python bench/identification.py $(SAVE)
	$(BIN)/python bench/runs.py $(SAVE)

bench-long: setup  ## the statistics of docs/validation, into bench/results/; takes days, goes on where it was stopped
	$(BIN)/python bench/accuracy.py --per-structure 1 --seed 1 2 3 --save
	$(BIN)/python bench/global_optimum.py --count 100 --seed 18 --noise 0.001 --save
	$(BIN)/python bench/global_optimum.py --count 100 --seed 19 --noise 0.01 --save
	$(BIN)/python bench/interval_coverage.py --truths 9 --draws 5 --structures 4 --seed 6 --save
	$(BIN)/python bench/interval_coverage.py --truths 9 --draws 5 --skip 4 --seed 3 --save
	$(BIN)/python bench/real_recordings.py --save
	$(BIN)/python bench/recovery.py run 0 400 --seed 18 --save
	$(BIN)/python bench/symptoms.py false --runs 60 --seed 101 --save
	$(BIN)/python bench/symptoms.py missing --runs 8 --save
	$(BIN)/python bench/genetic.py rates paper reference 0 100
	$(BIN)/python bench/genetic.py rates tuned reference 0 100
	$(BIN)/python bench/genetic.py rates paper others 0 20
	$(BIN)/python bench/genetic.py rates tuned others 0 20
	$(BIN)/python bench/genetic.py --save table
	$(BIN)/python bench/genetic.py --save exhaustive 319 360 --seed 18
	$(BIN)/python bench/control_methods.py consistency --runs 300 --save
	$(BIN)/python bench/control_methods.py cycles --runs 20 --save
	$(BIN)/python bench/control_methods.py faults --structure two_mass+coulomb+viscous --runs 200 --seed 7 --save
	$(BIN)/python bench/control_methods.py faults --structure two_mass+coulomb+viscous+backlash --runs 200 --save
	$(BIN)/python bench/control_methods.py emps --save

validation: setup  ## the pages docs/validation/*.md, made of the data in bench/results/
	$(BIN)/python bench/validation.py

pictures: setup  ## the picture of the README, from the demo
	$(BIN)/python bench/pictures.py

gallery: setup  ## the pages of docs/gallery, from bench/results/
	$(BIN)/python bench/gallery.py pages

clean:  ## remove what the targets above have made
	rm -rf .venv demo docs/build .pytest_cache .mypy_cache .ruff_cache .hypothesis
