# Each target does all its own set-up in .venv; nothing but Python (3.11 or later) and make is needed.
PYTHON ?= python3
BIN := .venv/bin
export OPENBLAS_NUM_THREADS ?= 1
export OMP_NUM_THREADS ?= 1
PARALLEL := -n auto --dist loadfile

.PHONY: help demo test slow check docs bench proof clean

help:
	@echo "make demo    run the cantilever in pipelines/ and show what came out (results/cantilever)"
	@echo "make test    formatter, linter, type checker, import directions, and all tests but the slow ones"
	@echo "make slow    the long proofs"
	@echo "make check   formatter, linter, type checker and import directions only"
	@echo "make docs    the documentation into docs/_build/html; warnings are errors"
	@echo "make bench   speed against peers and physical limits"
	@echo "make proof   blind cases: made, diagnosed, then opened and scored"
	@echo "make clean   remove .venv, results and what the documentation is built into"

.venv/run: pyproject.toml
	$(PYTHON) -c "import sys; sys.exit(sys.version_info < (3, 11) and 'Python 3.11 or later is needed')"
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable .
	@touch $@

.venv/test: .venv/run
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable ".[test]"
	@touch $@

.venv/peers: .venv/test
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable ".[test,peers]"
	@touch $@

.venv/docs: .venv/run
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable ".[docs]"
	@touch $@

demo: .venv/run
	$(BIN)/python pipelines/cantilever.py

test: .venv/test
	$(BIN)/python -m pytest $(PARALLEL)

slow: .venv/test
	$(BIN)/python -m pytest $(PARALLEL) -m slow

check: .venv/test
	$(BIN)/python -m pytest tests/architecture

docs: .venv/docs
	$(BIN)/python -m sphinx --fail-on-warning --keep-going --jobs auto --quiet docs docs/_build/html

bench: .venv/peers
	$(BIN)/python -m pytest tests/benchmarks --benchmark-only -s

proof: .venv/run
	$(BIN)/frf-testbench prove

clean:
	rm -rf .venv results docs/_build docs/auto_gallery docs/reference/api docs/reference/generated
