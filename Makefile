# LumenPilot. `make run` and `make test` set up all they need; `make help` lists the rest.

SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.ONESHELL:
.DEFAULT_GOAL := help
.PHONY: help run test tests damage mutation docs lint translations setup packages install uninstall clean

# Tools are started as modules, so that a checkout that was moved still works (the scripts in .venv/bin name their old place).
PY := .venv/bin/python
# Those of a ROS set-up, say, would hide the packages of .venv; and PYTHONSAFEPATH would hide the program itself.
unexport PYTHONPATH PYTHONHOME PYTHONSAFEPATH

help:  ## this list
	@echo "usage: make TARGET [ARGS='...'] [PYTHON=/path/to/python3.11]"
	sed -nE 's/^([a-z]+):.*## (.*)/  \1\t\2/p' $(firstword $(MAKEFILE_LIST)) | expand -t 12

run: setup  ## start the operator window (ARGS='...' is handed to main.py)
	@exec $(PY) main.py $(ARGS)

test:  ## ruff, mypy and pytest, no screen needed (ARGS='...' is handed to pytest)
	@$(MAKE) --no-print-directory --keep-going lint tests

tests: setup  ## pytest alone (ARGS='...' is handed to it)
	@$(PY) -m compileall -q app core hardware tools || true # once: else each of the processes does it
	$(PY) -m pytest $(ARGS)

damage: setup  ## 50 kills of a recording, 100 of saves, 2600 damaged files: what the tests do a few times (minutes)
	@export LUMENPILOT_FUZZ=1000
	only='damage_at_random or damaged_files_end or damaged_at_random'
	$(PY) -m pytest --timeout 3600 tests/core -k "$$only"
	LUMENPILOT_KILLS=50 $(PY) -m pytest --timeout 3600 tests/core/session/test_recovery.py -k is_killed
	LUMENPILOT_KILLS=100 $(PY) -m pytest --timeout 3600 tests/core/annotation/test_store.py -k kill_9

mutation: setup  ## does a test fail for every small change of gate, supervisor, force limit and bus guard? (a quarter to half an hour)
	@$(PY) -m tools.mutation $(ARGS)

lint: packages  ## ruff and mypy only
	@failed=
	$(PY) -m ruff check || failed=1
	nice $(PY) -m mypy || failed=1 # beside the tests, with --jobs 2, it takes what they leave: they often wait
	[[ -z $$failed ]]

docs: setup  ## README and docs/ as a site of HTML pages in out/site (ARGS=--new-pictures takes the pictures of the windows now)
	@$(PY) -m tools.docs_site $(ARGS)

translations: setup  ## renew the texts of resources/translations from the code, and make the .qm files
	@$(PY) -m tools.translations

setup:  ## make or renew .venv; returns at once when it is up to date
	@PYTHON='$(PYTHON)' bash scripts/set_up.sh

packages: # beside `setup` it is done once: whoever comes second waits
	@PYTHON='$(PYTHON)' bash scripts/set_up.sh packages

install: setup  ## put it into your desktop's menu, and the command lumenpilot into ~/.local/bin
	@bash scripts/desktop.sh install

uninstall:  ## take both out again
	@bash scripts/desktop.sh uninstall

clean:  ## remove .venv and all caches
	@rm -rf .venv .mypy_cache .pytest_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
