# Two commands on a fresh machine:  make demo   and   make test.  Each sets up its own .venv.
PYTHON ?= python3
ifeq ($(OS),Windows_NT)
BIN := .venv/Scripts
else
BIN := .venv/bin
endif
PIP := $(BIN)/python -m pip install -q --no-compile -c constraints.txt -e
export PIP_DISABLE_PIP_VERSION_CHECK := 1
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test quick test-all check bench mutants docs screenshot reports datasets wheel clean

demo: .venv/.run  ## the main job: three shipped datasets to one report
	$(BIN)/eaid demo -o demo --force

test: .venv/.test  ## all that guards a change, in five minutes on two cores
	$(MAKE) --no-print-directory -j 2 quick check

quick: .venv/.test
	$(BIN)/python -m pytest -n 2 -m "not slow"

test-all: check .venv/.dev  ## and the slow ones: coverage of intervals, emulators, browsers, kills, hypothesis at length
	$(BIN)/mypy
	$(BIN)/python -m pytest -n 2

check: .venv/.test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy eaid
	$(BIN)/lint-imports

bench: .venv/.bench  ## speed and quality against other tools, in one run
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m benchmarks

ROOMS ?= logs steps control replay estimate+recorded
N ?= 60
mutants: .venv/.dev  ## small wrong changes, one at a time: how many do the tests see?
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m benchmarks.mutants $(ROOMS) -n $(N)

docs: .venv/.docs  ## the site: site/index.html; a warning or a dead link is an error
	$(BIN)/python -m mkdocs build --strict

CHROMIUM ?= chromium
screenshot: reports  ## docs/figures/page.png, the first screen of the demo's page
	$(CHROMIUM) --headless --no-sandbox --hide-scrollbars --window-size=1280,970 --virtual-time-budget=8000 \
		--screenshot=docs/figures/page.png "file://$(CURDIR)/reports/demo/report.html"

reports: demo  ## reports/demo: the demo's answers, page and figures, without its recordings
	rm -rf reports/demo && cp -r demo reports/demo && rm reports/demo/*.h5
	sed -i.bak "s|$(CURDIR)/||g" reports/demo/report.html && rm reports/demo/report.html.bak

datasets: .venv/.run  ## the shipped synthetic logs again, byte for byte
	$(BIN)/python datasets/make.py

wheel: .venv/.dev
	$(BIN)/python -m build --wheel

.venv/.run: pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv
	$(PIP) .
	@touch $@

.venv/.test: pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv
	$(PIP) ".[test]"
	@touch .venv/.run $@

.venv/.dev: pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv
	$(PIP) ".[dev]"
	@touch .venv/.run .venv/.test $@

.venv/.bench: pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv
	$(PIP) ".[dev,bench]"
	@touch .venv/.run $@

.venv/.docs: pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv
	$(PIP) ".[docs]"
	@touch .venv/.run $@

clean:
	rm -rf .venv build dist demo site .mypy_cache .pytest_cache .ruff_cache .import_linter_cache
