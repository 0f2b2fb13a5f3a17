# make demo: run a synthetic site.  make test: run the tests.  make lint, make bench: for development.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
RUNTIME := $(VENV)/.runtime
STAMP := $(VENV)/.installed
NODE_STAMP := node_modules/.installed

# uv is seven times as fast as pip, but ignores pip's settings: if those name the index, pip installs.
install = UV_SYSTEM_CERTS=1 $(BIN)/uv pip install --quiet --python $(BIN)/python --constraint requirements/lock.txt --editable $(1) \
	|| $(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint requirements/lock.txt --editable $(1)

DOCS_STAMP := $(VENV)/.docs

.PHONY: demo test test-slow test-loaded lint lint-tests format bench docs lock sbom clean node_modules

demo: $(RUNTIME)
	$(BIN)/myview demo

# Runs every part, even after failures; the last line is the summary (tests/suite.py).
test: $(STAMP) node_modules
	$(BIN)/python tests/suite.py $(SUITE)

test-slow: $(STAMP) node_modules
	$(BIN)/python tests/suite.py --slow $(SUITE)

# Finds tests that are flaky or fail on a loaded machine: three hours on two cores.
test-loaded: $(STAMP) node_modules
	$(BIN)/python tests/suite.py --runs 20 --at-once 2 $(SUITE)

lint: $(STAMP) node_modules
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	@$(MAKE) --no-print-directory lint-tests
	$(BIN)/lint-imports
	@if [ -e $(NODE_STAMP) ]; then $(BIN)/node node_modules/typescript/bin/tsc; \
		else echo "types of the page: left out, npm could not fetch the TypeScript compiler"; fi

# Checks all test files at once, then each conftest.py, because these share one name.
lint-tests: $(STAMP)
	MYPYPATH=tests $(BIN)/mypy --config-file tests/mypy.ini $$(find tests -name '*.py' ! -name conftest.py)
	for file in $$(find tests -name conftest.py); do \
		MYPYPATH=tests $(BIN)/mypy --config-file tests/mypy.ini $$file || exit 1; done

format: $(STAMP)
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

bench: $(STAMP)
	$(BIN)/python -m benchmarks

# Builds the documentation into build/site.
docs: $(DOCS_STAMP)
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

# Pins the versions in requirements/lock.txt from the ranges in pyproject.toml.
lock: $(STAMP)
	$(BIN)/uv pip compile --quiet --universal --no-emit-index-url --no-emit-find-links --no-header \
		--extra dev --extra docs --output-file requirements/lock.txt pyproject.toml

# Lists what MyView needs to run, with versions and licenses, as CycloneDX: build/sbom.cdx.json.
sbom: $(STAMP)
	$(BIN)/python requirements/sbom.py build/sbom.cdx.json

# Installs only what MyView needs to run, for a fast start of the demo.
$(RUNTIME): pyproject.toml requirements/lock.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
		|| { echo "MyView needs Python 3.11 or newer; say which with: make PYTHON=/path/to/python3.11"; exit 1; }
	@$(PYTHON) -m venv $(VENV) \
		|| { echo "Python cannot make a virtual environment here; on Debian: apt install python3-venv"; exit 1; }
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile --constraint requirements/lock.txt uv
	$(call install,.)
	@touch $@

# Installs the tools of tests, lint and benchmarks.
$(STAMP): $(RUNTIME)
	$(call install,'.[dev]')
	@touch $@

# Installs the tools of the documentation.
$(DOCS_STAMP): $(STAMP)
	$(call install,'.[docs]')
	@touch $@

# Installs the checks of the page's JavaScript, if npm is reachable; the page itself needs none.
node_modules: $(STAMP)
	@$(MAKE) --silent $(NODE_STAMP) || echo "npm could not fetch what checks the page's types and accessibility:" \
		"those checks are left out. To see why: PATH=$(BIN):\$$PATH npm ci"

$(NODE_STAMP): package.json package-lock.json
	@echo "npm ci  (typescript and axe-core, to check the page)"
	@PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/npm ci --silent --fetch-retries=1 --fetch-timeout=20000
	@touch $@

clean:
	rm -rf $(VENV) node_modules build dist out *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis
