PYTHON ?= python3
BIN := .venv/bin
# The stamp's time is that of the last set-up: a changed list of packages sets up again.
STAMP := .venv/set-up
DOCS_STAMP := .venv/set-up-docs
# The oldest versions of the direct dependencies that the suite claims to work with.
LOWEST := .venv-lowest
LOWEST_STAMP := $(LOWEST)/set-up
# Two processes, a file of tests in one of them: what its tests share is computed once.
PYTEST := -m pytest -n 2 --dist loadfile

.PHONY: run test test-all test-lowest test-machines test-machines-short test-wheel lint check docs

run: $(STAMP)
	$(BIN)/velodrome run q2-plus

test: $(STAMP)
	$(BIN)/python $(PYTEST)

test-all: $(STAMP)
	$(BIN)/python $(PYTEST) -m ""

test-lowest: $(LOWEST_STAMP)
	$(LOWEST)/bin/python $(PYTEST)

# The tests that round-off could sway, as other CPUs would run them.
test-machines: $(STAMP)
	$(BIN)/python -m tests.machines

test-machines-short: $(STAMP)
	$(BIN)/python -m tests.machines --short

# The package as it is installed elsewhere: built, put into an empty environment, and used from there.
test-wheel: $(STAMP)
	$(BIN)/python -m tests.wheel

lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache

check: $(STAMP)
	$(BIN)/velodrome check

# The site, to be read from build/docs/html/index.html without a network; any warning is an error.
docs: $(DOCS_STAMP)
	$(BIN)/python -m sphinx -W --keep-going -q -j 2 -b html -d build/docs/doctrees docs build/docs/html

$(STAMP): pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; sys.exit("velodrome needs Python 3.11 or newer") if sys.version_info < (3, 11) else None'
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[dev]'
	touch $@

# What only the documentation needs.
$(DOCS_STAMP): $(STAMP)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[dev,docs]'
	touch $@

$(LOWEST_STAMP): pyproject.toml constraints-lowest.txt
	$(PYTHON) -m venv $(LOWEST)
	$(LOWEST)/bin/python -m pip install --quiet --disable-pip-version-check --constraint constraints-lowest.txt --editable '.[benchmark,cluster,notebook]' hypothesis ipykernel jsonschema nbclient pillow pytest pytest-xdist
	touch $@
