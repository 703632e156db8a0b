PYTHON ?= python3
BIN := .venv/bin
# Time stamp of the last set-up. The environment is set up again if a list of packages is newer.
STAMP := .venv/set-up
DOCS_STAMP := .venv/set-up-docs
# Environment with the oldest supported versions of the direct dependencies.
LOWEST := .venv-lowest
LOWEST_STAMP := $(LOWEST)/set-up
# Environment with the libraries of the engines that are extras.
ENGINES := .venv-engines
ENGINES_STAMP := $(ENGINES)/set-up
# Environment of the packages in examples/ whose libraries go with the suite's versions.
PACKAGES := .venv-packages
PACKAGES_STAMP := $(PACKAGES)/set-up
# Environment of the package velodrome-jiminy, whose library needs an older numpy.
JIMINY := .venv-jiminy
JIMINY_STAMP := $(JIMINY)/set-up
# What the tests of packages need besides the packages.
TESTING := hypothesis pytest pytest-xdist
# Run the tests in two processes, each file in one of them, so that fixtures of a file are computed once.
PYTEST := -m pytest -n 2 --dist loadfile

.PHONY: run warm-up environments test test-all test-engines test-packages test-lowest test-machines test-machines-short
.PHONY: test-pages test-wheel lint lint-style lint-pyright lint-mypy check docs

run: $(STAMP)
	$(BIN)/velodrome run q2-plus

# Compile the kernels ahead, on all cores, as for an image.
warm-up: $(STAMP)
	$(BIN)/velodrome warm-up

# What `.ci/run` needs, two at a time with `make -j 2`.
environments: $(DOCS_STAMP) $(LOWEST_STAMP) $(ENGINES_STAMP)

test: $(STAMP)
	$(BIN)/python $(PYTEST)

test-all: $(STAMP)
	$(BIN)/python $(PYTEST) -m ""

# Run the tests of the engines that are extras.
test-engines: $(ENGINES_STAMP)
	$(ENGINES)/bin/python $(PYTEST) -m engines

# Run the tests of the packages in examples/ whose engines are other people's libraries, and of those libraries' defects.
# Their test files have the same names, hence the mode of importing.
test-packages: $(PACKAGES_STAMP) $(JIMINY_STAMP)
	$(PACKAGES)/bin/python $(PYTEST) -m "" --import-mode importlib examples/velodrome-bullet examples/velodrome-dart tests/examples/test_bullet_defects.py tests/examples/test_dart_defects.py
	$(JIMINY)/bin/python $(PYTEST) -m "" --import-mode importlib examples/velodrome-jiminy tests/examples/test_jiminy_defects.py

# What the tests marked `once` show does not depend on the libraries' versions.
test-lowest: $(LOWEST_STAMP)
	$(LOWEST)/bin/python $(PYTEST) -m "not slow and not engines and not packages and not once"

# Run the tests that are sensitive to round-off with the instructions of other CPUs.
test-machines: $(STAMP)
	$(BIN)/python -m tests.machines

test-machines-short: $(STAMP)
	$(BIN)/python -m tests.machines --short

# Look at pages and recordings in Chromium, which is installed where it can be; tests that miss it say so.
test-pages: $(STAMP)
	-$(BIN)/python -m tests.reports.page.headless_page install
	$(BIN)/python $(PYTEST) -m "" tests/reports/page tests/scenarios/view

# Build the package, install it into an empty environment, and use it from there.
test-wheel: $(STAMP)
	$(BIN)/python -m tests.wheel

# The linters read the documentation's extensions too, hence its packages.
lint: lint-style lint-pyright lint-mypy

lint-style: $(DOCS_STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports --no-cache

lint-pyright: $(DOCS_STAMP)
	$(BIN)/pyright

lint-mypy: $(DOCS_STAMP)
	$(BIN)/mypy

check: $(STAMP)
	$(BIN)/velodrome check

# Build the documentation, which starts at build/docs/html/index.html; warnings are errors.
docs: $(DOCS_STAMP)
	$(BIN)/python -m sphinx -W --keep-going -q -j 2 -b html -d build/docs/doctrees docs build/docs/html

$(STAMP): pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; sys.exit("velodrome needs Python 3.11 or newer") if sys.version_info < (3, 11) else None'
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[dev]'
	touch $@

# Packages for the documentation.
$(DOCS_STAMP): $(STAMP)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[dev,docs]'
	touch $@

$(ENGINES_STAMP): pyproject.toml constraints.txt constraints-engines.txt
	$(PYTHON) -m venv $(ENGINES)
	$(ENGINES)/bin/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --constraint constraints-engines.txt --editable '.[dev,engines]'
	touch $@

$(PACKAGES_STAMP): pyproject.toml constraints.txt constraints-packages.txt examples/velodrome-bullet/pyproject.toml examples/velodrome-dart/pyproject.toml
	$(PYTHON) -m venv $(PACKAGES)
	$(PACKAGES)/bin/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --constraint constraints-packages.txt --editable . --editable examples/velodrome-bullet --editable examples/velodrome-dart $(TESTING)
	touch $@

$(JIMINY_STAMP): pyproject.toml constraints-jiminy.txt examples/velodrome-jiminy/pyproject.toml
	$(PYTHON) -m venv $(JIMINY)
	$(JIMINY)/bin/python -m pip install --quiet --disable-pip-version-check --constraint constraints-jiminy.txt --editable . --editable examples/velodrome-jiminy $(TESTING)
	touch $@

$(LOWEST_STAMP): pyproject.toml constraints-lowest.txt
	$(PYTHON) -m venv $(LOWEST)
	$(LOWEST)/bin/python -m pip install --quiet --disable-pip-version-check --constraint constraints-lowest.txt --editable '.[benchmark,cluster,notebook]' hypothesis ipykernel jsonschema nbclient pillow pytest pytest-xdist
	touch $@
