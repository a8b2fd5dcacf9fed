# Each target does all its own set-up in .venv; nothing but Python (3.11 or later) and make is needed.
PYTHON ?= python3
BIN := .venv/bin
export OPENBLAS_NUM_THREADS ?= 1
export OMP_NUM_THREADS ?= 1
# --no-compile: Python compiles what it imports the first time, and keeps it, whatever the environment says; compiling
# all of every package takes half of the set-up.
unexport PYTHONDONTWRITEBYTECODE
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile
PARALLEL := -n auto --dist loadfile --no-loadscope-reorder
LOCK := $(BIN)/uv pip compile --quiet --upgrade --universal --python-version 3.11 --generate-hashes \
	--custom-compile-command "make lock" pyproject.toml

.PHONY: help demo test slow check docs bench proof lock audit clean

help:
	@echo "make demo    run the cantilever in pipelines/ and show what came out (results/cantilever)"
	@echo "make test    formatter, linter, type checker, import directions, and all tests but the slow ones"
	@echo "make slow    the long proofs"
	@echo "make check   formatter, linter, type checker and import directions only"
	@echo "make docs    the documentation into docs/_build/html; warnings are errors"
	@echo "make bench   speed against peers and physical limits"
	@echo "make proof   blind cases: made, diagnosed, then opened and scored"
	@echo "make lock    newest versions within the ranges of pyproject.toml into requirements/"
	@echo "make audit   known vulnerabilities of the locked packages, by pip-audit"
	@echo "make clean   remove .venv, results and what the documentation is built into"

.venv/run: pyproject.toml requirements/run.txt
	$(PYTHON) -c "import sys; sys.exit(sys.version_info < (3, 11) and 'Python 3.11 or later is needed')"
	$(PYTHON) -m venv .venv
	$(PIP) --require-hashes -r requirements/run.txt
	$(PIP) --no-deps --no-build-isolation -e .
	@touch $@

.venv/test: .venv/run requirements/test.txt
	$(PIP) --require-hashes -r requirements/test.txt
	@touch $@

.venv/docs: .venv/run requirements/docs.txt
	$(PIP) --require-hashes -r requirements/docs.txt
	@touch $@

.venv/peers: .venv/test
	$(PIP) --no-build-isolation -e ".[peers]"
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

bench: .venv/peers  # writes results/timings.json too
	$(BIN)/python -m pytest tests/benchmarks --benchmark-only -s

proof: .venv/run
	$(BIN)/frf-testbench prove

lock: .venv/run
	$(PIP) "uv>=0.6"
	$(LOCK) --group build -o requirements/run.txt
	$(LOCK) --group build --extra test -c requirements/run.txt -o requirements/test.txt
	$(LOCK) --group build --extra docs -c requirements/test.txt -o requirements/docs.txt

audit: .venv/run
	$(PIP) "pip-audit>=2.7"
	$(BIN)/python -m pip_audit --require-hashes --disable-pip -r requirements/docs.txt

clean:
	rm -rf .venv results docs/_build docs/auto_gallery docs/reference/api docs/reference/generated
