# Every target builds what it needs. PYTHON picks the interpreter that makes the environment:
#   make compare PYTHON=python3.12
# On Linux pip fetches PyTorch with CUDA; set PIP_EXTRA_INDEX_URL to PyTorch's CPU index for a small one.

PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin

ARGS        ?=
ENVS        ?= highway-fast-v0 intersection-v0
# a decision where roads cross costs several times one on a motorway
BUDGET_intersection-v0 := --total-timesteps 50000
PYTEST_ARGS ?= -n 2

.DEFAULT_GOAL := help
.NOTPARALLEL:
.PHONY: help compare $(ENVS:%=compare-%) test test-fast prove mutants bench evidence campaign paper docs check clean

help:            ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-9s %s\n", $$1, $$2 }' Makefile
	@echo
	@echo "  PYTHON=$(PYTHON) makes the environment; ARGS='--total-timesteps 1000000' goes to train.py;"
	@echo "  ENVS='highway-fast-v0 intersection-v0' are the environments of compare;"
	@echo "  a small one: make compare ENVS=highway-fast-v0 ARGS='--total-timesteps 20000 --seeds 0 --eval-episodes 100';"
	@echo "  PLAN=short or full is how much of the campaign paper runs, DIVIDE=1000 tries all of it in minutes."

compare: $(ENVS:%=compare-%)  ## train and compare shielded with unshielded PPO (minutes)

# one run per environment, each in a folder of its own; what ARGS says comes last and wins
$(ENVS:%=compare-%): compare-%: $(VENV)/installed
	$(BIN)/python train.py --env-id $* $(BUDGET_$*) $(ARGS)

test: $(VENV)/installed-dev  ## run every test
	$(BIN)/python -m pytest $(PYTEST_ARGS)

test-fast: $(VENV)/installed-dev  ## run the tests of single functions and small scenes (a minute)
	$(BIN)/python -m pytest $(PYTEST_ARGS) -m "not slow"

prove: $(VENV)/installed-dev  ## prove the induction with z3 and write the page (minutes)
	$(BIN)/python tests/proofs/prove.py --write $(ARGS)

# a sample of each package, then the page; what was tested before is not tested again
mutants: $(VENV)/installed-dev  ## alter the sources of the shield and see whether tests notice (an hour)
	$(BIN)/python -m pip install --quiet -c constraints.txt -e '.[mutants]'
	$(BIN)/python bench/mutants.py $(ARGS)
	$(BIN)/python bench/mutants.py --write

bench: $(VENV)/installed-dev  ## run the benchmarks
	$(BIN)/python -m pytest bench --benchmark-only -q -s

evidence: $(VENV)/installed  ## play scripted policies under the shield and count who is to blame (hours)
	$(BIN)/python bench/evidence.py $(ARGS)

# one after the other; what has been run is not run again, so a stopped one goes on. Try the whole chain: DIVIDE=1000
PLAN   ?= short
DIVIDE ?= 1
paper: $(VENV)/installed-dev  ## run every experiment of the results pages, write them and a report (hours)
	$(BIN)/python bench/paper.py --plan $(PLAN) --divide $(DIVIDE) $(ARGS)

campaign: $(VENV)/installed  ## train every arm on two roads with many seeds, or go on with it (hours)
	$(BIN)/python bench/campaign.py $(ARGS)

docs: $(VENV)/installed-docs  ## build the site into docs/_build/html
	$(BIN)/sphinx-build -W --keep-going -q -b html docs docs/_build/html

check: $(VENV)/installed-dev  ## lint, formatting and types
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

clean:           ## remove the environment and every cache; runs/ stays
	rm -rf $(VENV) build docs/_build docs/api *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis .benchmarks
	find . -name __pycache__ -type d -not -path './$(VENV)/*' -prune -exec rm -rf {} +

# A stamp is newer than what it was made from, or the step runs again.
$(VENV)/installed: pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null || { \
	  echo "rss-shield needs Python 3.11 or newer; $(PYTHON) is $$($(PYTHON) --version 2>/dev/null || echo missing)."; \
	  echo "Name another interpreter: make PYTHON=python3.11"; exit 1; } >&2
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet -c constraints.txt -e '.[train]'
	@touch $@

$(VENV)/installed-dev: $(VENV)/installed
	$(BIN)/python -m pip install --quiet -c constraints.txt -e '.[test,oracle,bench,proofs]'
	@touch $@

$(VENV)/installed-docs: $(VENV)/installed
	$(BIN)/python -m pip install --quiet -c constraints.txt -e '.[docs]'
	@touch $@
