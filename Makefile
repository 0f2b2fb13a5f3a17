# make demo: see it run.  make test: believe it.  make lint, make bench: for those who change it.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
RUNTIME := $(VENV)/.runtime
STAMP := $(VENV)/.installed
NODE_STAMP := node_modules/.installed

# uv takes a seventh of pip's time. It does not read pip's own settings: where those name the index, pip does it.
install = UV_SYSTEM_CERTS=1 $(BIN)/uv pip install --quiet --python $(BIN)/python --constraint requirements/lock.txt --editable $(1) \
	|| $(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint requirements/lock.txt --editable $(1)

DOCS_STAMP := $(VENV)/.docs

.PHONY: demo test test-slow test-loaded lint lint-tests format bench docs lock clean node_modules

demo: $(RUNTIME)
	$(BIN)/myview demo

# Every part runs, whatever fails, and the last line sums them up (tests/suite.py).
test: $(STAMP) node_modules
	$(BIN)/python tests/suite.py $(SUITE)

test-slow: $(STAMP) node_modules
	$(BIN)/python tests/suite.py --slow $(SUITE)

# Whether a test depends on luck, or on a machine that has nothing else to do: two hours on two cores.
test-loaded: $(STAMP) node_modules
	$(BIN)/python tests/suite.py --runs 20 --at-once 5 $(SUITE)

lint: $(STAMP) node_modules
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	@$(MAKE) --no-print-directory lint-tests
	$(BIN)/lint-imports
	@if [ -e $(NODE_STAMP) ]; then $(BIN)/node node_modules/typescript/bin/tsc; \
		else echo "types of the page: left out, npm could not fetch the TypeScript compiler"; fi

# All files of tests at once, and then each conftest.py: those share one name.
lint-tests: $(STAMP)
	MYPYPATH=tests $(BIN)/mypy --config-file tests/mypy.ini $$(find tests -name '*.py' ! -name conftest.py)
	for file in $$(find tests -name conftest.py); do \
		MYPYPATH=tests $(BIN)/mypy --config-file tests/mypy.ini $$file || exit 1; done

format: $(STAMP)
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

bench: $(STAMP)
	$(BIN)/python -m benchmarks

# The documents as a site, in build/site.
docs: $(DOCS_STAMP)
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

# The pins in requirements/lock.txt, made anew from the ranges in pyproject.toml.
lock: $(STAMP)
	$(BIN)/uv pip compile --quiet --universal --no-emit-index-url --no-emit-find-links --no-header \
		--extra dev --extra docs --output-file requirements/lock.txt pyproject.toml

# What runs MyView, and no more: the demo starts soon.
$(RUNTIME): pyproject.toml requirements/lock.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
		|| { echo "MyView needs Python 3.11 or newer; say which with: make PYTHON=/path/to/python3.11"; exit 1; }
	@$(PYTHON) -m venv $(VENV) \
		|| { echo "Python cannot make a virtual environment here; on Debian: apt install python3-venv"; exit 1; }
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile --constraint requirements/lock.txt uv
	$(call install,.)
	@touch $@

# What tests, lint and benchmarks need beside it.
$(STAMP): $(RUNTIME)
	$(call install,'.[dev]')
	@touch $@

# What builds the documents.
$(DOCS_STAMP): $(STAMP)
	$(call install,'.[docs]')
	@touch $@

# What checks the page's JavaScript, where npm answers: the page itself needs nothing of it.
node_modules: $(STAMP)
	@$(MAKE) --silent $(NODE_STAMP) || echo "npm could not fetch what checks the page's types and accessibility:" \
		"those checks are left out. To see why: PATH=$(BIN):\$$PATH npm ci"

$(NODE_STAMP): package.json package-lock.json
	@echo "npm ci  (typescript and axe-core, to check the page)"
	@PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/npm ci --silent --fetch-retries=1 --fetch-timeout=20000
	@touch $@

clean:
	rm -rf $(VENV) node_modules build dist out *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis
