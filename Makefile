# Two commands matter: `make demo` dreams one caption, `make test` says whether all is well. Both set up what they need.
# A fresh machine needs Python 3.11 or newer and make. PYTHON=... chooses the interpreter, CAPTION=... the dream,
# WORKERS=... how many processes share the default tests.

SHELL := /bin/sh
.SHELLFLAGS := -eu -c
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:

CAPTION ?= a red mushroom
PRESET ?= draft
OUT ?= dreams
WORKERS ?= 2
VENV := .venv
PY := $(VENV)/bin/python
PYTEST := PREFECT_SERVER_ANALYTICS_ENABLED=false DO_NOT_TRACK=1 $(PY) -m pytest
DECIMATION := meshing_decimation_quadric_edge_collapse
MESH_CHECK ?= $(PY) -c "import sys, pymeshlab; sys.exit('$(DECIMATION)' not in pymeshlab.filter_list())"
SOURCES := flows tasks storage dreamfields_core tests $(wildcard benchmarks)

.PHONY: help setup demo test test-slow test-parity lint format clean

help:
	@echo 'make demo       dream one caption (CAPTION="a red mushroom") and say where the object is'
	@echo 'make test       style, types and the default tests'
	@echo 'make test-slow  the tests that take minutes'
	@echo 'make test-parity  published models against PyTorch, which it installs'
	@echo 'make setup      only install;  make lint: only style and types;  make format;  make clean'

setup: $(VENV)/.libraries

$(VENV)/.installed: pyproject.toml constraints.txt
	@if ! { [ -x $(PY) ] && $(PY) -c 'import sys, pip; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; }; then \
	  found=; \
	  for candidate in $(PYTHON) python3.11 python3.12 python3.13 python3 python; do \
	    if "$$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then found=$$candidate; break; fi; \
	  done; \
	  if [ -z "$$found" ]; then \
	    echo 'expected Python 3.11 or newer, found none: install it, or name it with `make PYTHON=/path/to/python`' >&2; exit 1; \
	  fi; \
	  "$$found" -m venv --clear $(VENV) || { \
	    echo "$$found cannot make virtual environments: install its venv module (on Debian and Ubuntu: apt-get install python3-venv)" >&2; \
	    exit 1; }; \
	fi
	@echo 'Installing what the project stands on (some minutes the first time) ...'
	@$(PY) -m pip install --quiet --disable-pip-version-check -e '.[test]' -c constraints.txt
	@touch $@

# pymeshlab imports without libOpenGL, but then lacks simplification: ask for the filter itself.
$(VENV)/.libraries: $(VENV)/.installed
	@if ! $(MESH_CHECK) >/dev/null 2>&1; then \
	  as_root=; [ "$$(id -u)" = 0 ] || as_root='sudo -n'; \
	  if command -v apt-get >/dev/null 2>&1; then \
	    echo 'Installing the system libraries that pymeshlab needs: libgl1 libopengl0 ...'; \
	    { $$as_root apt-get update -qq \
	      && $$as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends libgl1 libopengl0; \
	    } >/dev/null 2>&1 || true; \
	  fi; \
	  if ! $(MESH_CHECK) >/dev/null 2>&1; then \
	    echo 'pymeshlab cannot simplify meshes without the libraries libGL and libOpenGL: install them' \
	      '(on Debian and Ubuntu: sudo apt-get install libgl1 libopengl0), then run make again' >&2; \
	    exit 1; \
	  fi; \
	fi
	@touch $@

demo: setup
	@$(VENV)/bin/dreamfields dream "$(CAPTION)" --preset $(PRESET) --out "$(OUT)"

test: lint
	@$(PYTEST) -n $(WORKERS) --dist loadfile

# Exit code 5 says that no test is marked slow: nothing to run is nothing failed.
test-slow: setup
	@$(PYTEST) -m slow --timeout 1800 || { code=$$?; [ $$code -eq 5 ] || exit $$code; }

# Published models against the implementation that is trusted; PyTorch is large, so it is asked for apart.
test-parity: setup
	@$(PY) -m pip install --quiet --disable-pip-version-check -e '.[test,parity]' -c constraints.txt
	@$(PYTEST) tests/guidance/published -m 'parity or slow or not slow' --timeout 1800

lint: setup
	@$(PY) -m ruff check $(SOURCES)
	@$(PY) -m ruff format --check --quiet $(SOURCES) || { echo 'some files are not formatted: run `make format`' >&2; exit 1; }
	@$(PY) -m mypy

format: setup
	@$(PY) -m ruff check --fix --quiet $(SOURCES) || true
	@$(PY) -m ruff format --quiet $(SOURCES)

clean:
	rm -rf $(VENV) .cache .hypothesis .mypy_cache .pytest_cache .ruff_cache build dist *.egg-info
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
