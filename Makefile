# make demo: see it run.  make test: believe it.  make lint, make bench: for those who change it.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
NODE_STAMP := node_modules/.installed
TESTED := $(sort $(dir $(wildcard tests/*.py tests/*/*.py)))
AGAIN ?= --reruns 2 --reruns-delay 1

.PHONY: demo test test-slow lint format bench lock clean

demo: $(STAMP)
	$(BIN)/myview demo

# First libraries and services; then browsers and whole sites, which run in real time. Three at once for two cores:
# a third of it waits for a disk, a browser or the next frame.
# Machines are shared: what fails is tried again and told of as RERUN. What is wrong fails every time.
test: $(STAMP) $(NODE_STAMP)
	$(BIN)/pytest -m "not slow" $(AGAIN) -n 3 --dist loadfile --ignore tests/client --ignore tests/e2e
	$(BIN)/pytest -m "not slow" $(AGAIN) -n 3 --dist loadfile tests/client tests/e2e

test-slow: $(STAMP) $(NODE_STAMP)
	$(BIN)/pytest -m slow --timeout 1800

lint: $(STAMP) $(NODE_STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	for room in $(TESTED); do MYPYPATH=tests:$$room $(BIN)/mypy --config-file tests/mypy.ini $$room*.py || exit 1; done
	$(BIN)/lint-imports
	$(BIN)/node node_modules/typescript/bin/tsc

format: $(STAMP)
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

bench: $(STAMP)
	$(BIN)/python -m benchmarks

# The pins in requirements/lock.txt, made anew from the ranges in pyproject.toml.
lock: $(STAMP)
	$(BIN)/python -m pip install --quiet uv
	$(BIN)/uv pip compile --quiet --universal --no-emit-index-url --no-emit-find-links --no-header \
		--extra dev --output-file requirements/lock.txt pyproject.toml

$(STAMP): pyproject.toml requirements/lock.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
		|| { echo "MyView needs Python 3.11 or newer; say which with: make PYTHON=/path/to/python3.11"; exit 1; }
	@$(PYTHON) -m venv $(VENV) \
		|| { echo "Python cannot make a virtual environment here; on Debian: apt install python3-venv"; exit 1; }
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint requirements/lock.txt --editable '.[dev]'
	@touch $@

# What checks the page's JavaScript: the page itself needs nothing of it.
$(NODE_STAMP): $(STAMP) package.json package-lock.json
	@echo "npm ci  (typescript and axe-core, to check the page)"
	@PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/npm ci --silent \
		|| { echo "npm could not fetch what checks the page; to see why: PATH=$(BIN):\$$PATH npm ci." \
			"All else without it: $(BIN)/pytest -m 'not slow'"; exit 1; }
	@touch $@

clean:
	rm -rf $(VENV) node_modules build dist out *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis
