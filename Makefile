# `make demo` runs the main job, `make test` everything that CI runs. Each sets up .venv by itself.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
RUN    := $(BIN)/python -m
VERSIONS := 3.12 3.13  # beside the one that .venv has

.PHONY: demo test test-versions lint types layers check-compiled check-plain evidence bench docs clean
demo: $(VENV)/.installed
	$(BIN)/outrider demo --output demo --force

# The two passes of the tests need a core each; what either prints comes when it ends.
test: lint types layers
	$(MAKE) --jobs=2 --output-sync --keep-going check-compiled check-plain

$(VENV)/.installed: pyproject.toml constraints.txt
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(RUN) pip install --quiet --disable-pip-version-check "pip>=25.1"
	$(RUN) pip install --quiet --disable-pip-version-check -c constraints.txt -e .
	touch $@

$(VENV)/.ready: $(VENV)/.installed
	$(RUN) pip install --quiet --disable-pip-version-check -c constraints.txt --group dev -e .
	touch $@

lint: $(VENV)/.ready
	$(RUN) ruff check src tests benchmarks examples
	$(RUN) ruff format --check src tests benchmarks examples

types: $(VENV)/.ready
	$(BIN)/pyright

layers: $(VENV)/.ready
	$(BIN)/lint-imports

check-compiled: $(VENV)/.ready
	$(RUN) pytest -m "not evidence"

# The same code as plain Python: shows what the compiler hides (shapes, bounds) and measures coverage.
check-plain: $(VENV)/.ready
	NUMBA_DISABLE_JIT=1 $(RUN) pytest -m "not evidence and not compiled" --cov --cov-report=term:skip-covered

# The compiled pass under every other version of Python that is found (on the path, or pyenv's); TESTS names a part.
TESTS ?= tests
test-versions: $(addprefix test-python-,$(VERSIONS))
test-python-%: pyproject.toml constraints.txt
	@for found in python$* $${PYENV_ROOT:-$$HOME/.pyenv}/versions/$*.*/bin/python$* ""; do \
	  if "$$found" -c "" 2>/dev/null; then break; fi; done; \
	if test -z "$$found"; then echo "Python $*: not found, not tested"; exit 0; fi; \
	echo "Python $*: $$found"; \
	test -x $(VENV)-$*/bin/python || "$$found" -m venv $(VENV)-$* && \
	$(VENV)-$*/bin/python -m pip install --quiet --disable-pip-version-check "pip>=25.1" && \
	$(VENV)-$*/bin/python -m pip install --quiet --disable-pip-version-check -c constraints.txt --group dev -e . && \
	$(VENV)-$*/bin/python -m pytest -p no:cacheprovider -m "not evidence" $(TESTS)

evidence: $(VENV)/.ready
	$(RUN) pytest -m evidence -s

bench: $(VENV)/.ready
	$(RUN) benchmarks

# The site; the examples are run for its gallery.
docs: $(VENV)/.ready
	$(RUN) sphinx --jobs auto --fail-on-warning --keep-going --quiet -b html docs docs/_build/html
	@echo "open docs/_build/html/index.html"

clean:
	rm -rf $(VENV) $(VENV)-* .pytest_cache .ruff_cache .hypothesis .coverage demo docs/_build docs/gallery docs/reference
