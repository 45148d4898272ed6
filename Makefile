# Everything from a fresh clone with Rust, Python >= 3.11 and a C compiler; cargo and pip fetch the rest.
# .venv/ and the cargo target folder are reused, so a second run does only what changed.

.DEFAULT_GOAL := help
.PHONY: help build demo test test-rust test-python test-oldest-usd lint lint-rust lint-python fmt bench stress wheel clean

# The oldest interpreter that is there: the wheel is built against 3.11 and serves every later one.
PYTHON ?= $(firstword $(foreach p,python3.11 python3.12 python3.13 python3.14 python3,$(if $(shell $(p) --version 2>/dev/null),$(p))))
VENV := $(CURDIR)/.venv
BIN := $(VENV)/bin
TOOLS := $(VENV)/.tools.stamp
EXTENSION := $(VENV)/.extension.stamp
WHEEL := dist/.wheel.stamp
OUT := out
# The oldest USD that pyproject.toml promises, in an environment of its own.
OLDEST_USD := $(shell sed -n 's/^usd = \["usd-core>=\(.*\)"\]$$/\1/p' pyproject.toml)
OLDEST := $(VENV)/usd-$(OLDEST_USD)

# maturin and pyo3 look for the interpreter here, whichever shell calls make.
export VIRTUAL_ENV := $(VENV)
export PYO3_PYTHON := $(BIN)/python
export PIP_DISABLE_PIP_VERSION_CHECK := 1
unexport PYTHONHOME PYTHONPATH

CORE_SOURCES := Cargo.toml Cargo.lock python/Cargo.toml python/build.rs \
  $(shell find src python/src plugin -type f 2>/dev/null)
PACKAGE_SOURCES := pyproject.toml $(wildcard README.md LICENSE-*) \
  $(shell find python/abbe -type f \( -name '*.py' -o -name '*.pyi' -o -name 'py.typed' \) 2>/dev/null)

help:
	@echo 'make build   the package with everything, in .venv'
	@echo 'make demo    build, install into .venv, render stages to $(OUT)/, check them, write previews'
	@echo 'make test    every test: Rust, documentation, Python, the wheel in an empty environment'
	@echo 'make test-oldest-usd   tests of everything that meets USD, with the oldest version promised'
	@echo 'make lint    formatting, clippy, rustdoc, ruff, mypy'
	@echo 'make fmt     format everything'
	@echo 'make bench   speed and error against time'
	@echo 'make stress  long randomised comparison with multi-precision arithmetic'
	@echo 'make wheel   dist/*.whl'
	@echo 'make clean   remove what these made, but for the cargo target folder'

$(BIN)/python:
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "abbe needs Python 3.11 or later")'
	$(PYTHON) -m venv $(VENV)

$(TOOLS): pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --quiet --upgrade 'pip>=25.1'
	$(BIN)/python -m pip install --quiet --group dev
# An optics package as a second opinion on lenses. Its ray trace imports these two; the rest of what it asks for is a desktop.
	$(BIN)/python -m pip install --quiet --no-deps rayoptics==0.9.8 opticalglass==1.1.1 transforms3d==0.4.2
	@touch $@

# Editable: a change of a Python file needs no installation.
$(EXTENSION): $(CORE_SOURCES) pyproject.toml $(TOOLS)
	$(BIN)/maturin develop --release --extras all
	@touch $@

build: $(EXTENSION)

$(WHEEL): $(CORE_SOURCES) $(PACKAGE_SOURCES) $(TOOLS)
	@rm -rf dist && mkdir -p dist
	$(BIN)/maturin build --release --out dist
	@touch $@

wheel: $(WHEEL)
	@ls dist/*.whl

demo: $(EXTENSION)
	@mkdir -p $(OUT)
	$(BIN)/abbe render stages/prism.usda $(OUT)/prism.exr --preview $(OUT)/prism.png
	$(BIN)/abbe check $(OUT)/prism.exr
	$(BIN)/abbe render stages/ball.usda $(OUT)/ball.exr --integrator path --aov color --aov dispersion --width 320 --samples 64 \
	  --preview $(OUT)/ball.png
	$(BIN)/abbe check $(OUT)/ball.exr
	@echo 'Look at $(OUT)/prism.png and $(OUT)/ball.png; the EXRs beside them have every layer.'

test: test-rust test-python test-oldest-usd

# nextest runs faster where somebody installed it; it has no documentation tests.
test-rust:
	@if cargo nextest --version >/dev/null 2>&1; then \
	  echo 'cargo nextest run' && cargo nextest run && cargo test --doc; \
	else \
	  echo 'cargo test' && cargo test; \
	fi

# abbe-render comes in the profile of `cargo test`, which has compiled the library for it already.
test-python: $(EXTENSION) $(WHEEL)
	cargo build --quiet --bin abbe-render
	ABBE_WHEEL="$$(ls $(CURDIR)/dist/*.whl)" ABBE_RENDER="$(abspath $(or $(CARGO_TARGET_DIR),target))/debug/abbe-render" \
	  $(BIN)/python -m pytest

$(OLDEST)/.stamp: pyproject.toml | $(BIN)/python
	$(BIN)/python -m venv $(OLDEST)
	$(OLDEST)/bin/python -m pip install --quiet --only-binary :all: usd-core==$(OLDEST_USD) 'numpy>=1.26' 'openimageio>=3.0' 'pillow>=10' 'pytest>=8'
	@touch $@

# All that meets USD. Its wheels end with Python 3.12; on a later one this is skipped, and says so.
test-oldest-usd: $(EXTENSION)
	@if $(BIN)/python -c 'import sys; sys.exit(sys.version_info >= (3, 13))'; then \
	  $(MAKE) --no-print-directory $(OLDEST)/.stamp && echo 'pytest with USD $(OLDEST_USD)' && \
	  PYTHONPATH=$(CURDIR)/python $(OLDEST)/bin/python -m pytest -q -p no:cacheprovider \
	    tests/python/test_plugin.py tests/python/test_registration.py tests/python/test_validators.py \
	    tests/python/test_bridge_*.py; \
	else \
	  echo 'SKIPPED: usd-core $(OLDEST_USD), the oldest that abbe promises to work with, has no wheel for this Python'; \
	fi

lint: lint-rust lint-python

lint-rust: $(TOOLS)
	cargo fmt --all --check
	cargo clippy --workspace --all-targets -- -D warnings
	RUSTDOCFLAGS='-D warnings' cargo doc --workspace --no-deps --document-private-items

lint-python: $(EXTENSION)
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/python -m mypy.stubtest abbe._core

fmt: $(TOOLS)
	cargo fmt --all
	$(BIN)/ruff check --fix --quiet
	$(BIN)/ruff format

# Figures that were kept stand in benches/RESULTS.md.
bench: $(EXTENSION)
	@mkdir -p $(OUT)
	$(BIN)/abbe bench stages/gem.usda stages/ball.usda stages/prism.usda --csv $(OUT)/bench.csv --plot $(OUT)/bench.png
	cargo bench

stress: $(TOOLS)
	cargo test --release --test stress -- --ignored --nocapture

clean:
	rm -rf $(VENV) dist $(OUT) python/abbe/plugin python/abbe/_core*.so
	find python tests -name __pycache__ -type d -exec rm -rf {} +
