# make demo    install what is missing, build, put dem-mpi on the PATH, run the quickstart on two ranks
# make test    the same set-up, then all tests
# make help    the other targets

SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DEFAULT_GOAL := help
.PHONY: help demo test figures-wahn2022 lint bench bench-peers build install docs serial static setup setup-test

# Before each command: PATH, root and HDF5 as this machine needs them.
ENVIRONMENT := . scripts/environment.sh; hdf5_dir=$$(parallel_hdf5_dir); \
    if [ -n "$$hdf5_dir" ]; then export HDF5_DIR="$$hdf5_dir"; fi;
TARGET := $(or $(CARGO_TARGET_DIR),target)
CARGO_FLAGS := --locked

help:
	@echo "make demo       install what is missing, build, run the quickstart on two ranks"
	@echo "make test       the same set-up, then all tests"
	@echo "make figures-wahn2022  the figures of the viscoelastic paper, compared with what they must show"
	@echo "make lint       formatting, clippy, architecture, scripts"
	@echo "make bench      particle-steps/s on one and two ranks and threads"
	@echo "make bench-peers  the same packings in LAMMPS and LIGGGHTS"
	@echo "make build      build the program"
	@echo "make install    build and copy dem-mpi into cargo's bin folder"
	@echo "make docs       write docs/input.md anew from the program"
	@echo "make serial     build without MPI, into $(TARGET)/serial"
	@echo "make static     build without MPI, HDF5 built along, into $(TARGET)/static (CMake 3.26 or newer)"

setup:
	@scripts/setup.sh parallel

setup-test:
	@scripts/setup.sh parallel python

build: setup
	@$(ENVIRONMENT) cargo build --release $(CARGO_FLAGS)

install: build
	@$(ENVIRONMENT) mkdir -p "$$cargo_bin"; install -m 755 "$(TARGET)/release/dem-mpi" "$$cargo_bin/dem-mpi"

demo: install
	@scripts/demo.sh

test: setup-test
	@$(ENVIRONMENT) cargo test --release $(CARGO_FLAGS)
	@scripts/check_snapshots.sh "$(TARGET)/release/dem-mpi"
	@$(ENVIRONMENT) "$(TARGET)/release/dem-mpi" verify

# FIGURES="--seeds 5 --only 15,16" widens or narrows it; pictures and table in runs/wahn2022.
figures-wahn2022: build
	@$(ENVIRONMENT) "$(TARGET)/release/dem-mpi" verify wahn2022 $(FIGURES)

lint: setup
	@$(ENVIRONMENT) cargo fmt --check
	@$(ENVIRONMENT) cargo clippy --release --all-targets $(CARGO_FLAGS) -- -D warnings
	@$(ENVIRONMENT) cargo test --release $(CARGO_FLAGS) --quiet --test architecture
	@for script in scripts/*.sh jobscripts/*.sh .ci/run; do bash -n "$$script"; done
	@if command -v shellcheck >/dev/null; then shellcheck -x scripts/*.sh jobscripts/*.sh .ci/run; fi

# BENCH="--particles 1000000 --layouts 2x1" narrows or widens it.
bench: build
	@$(ENVIRONMENT) "$(TARGET)/release/dem-mpi" bench $(BENCH)

# SIZES="10000" RANKS="1" REPEATS=5 narrow it; LAMMPS_NATIVE=/path/to/lmp adds a LAMMPS of your own.
bench-peers: build
	@$(ENVIRONMENT) scripts/bench_peers.sh "$(TARGET)/release/dem-mpi"

docs: build
	@mkdir -p docs; { echo "# Input reference"; echo; echo "Written by \`make docs\` from the program's own tables."; echo; \
	    "$(TARGET)/release/dem-mpi" reference; } >docs/input.md

serial:
	@scripts/setup.sh serial
	@. scripts/environment.sh; \
	    if [ -z "$${HDF5_DIR:-}" ] && hdf5_dir=$$(debian_hdf5 serial); then export HDF5_DIR="$$hdf5_dir"; fi; \
	    cargo build --release --no-default-features $(CARGO_FLAGS) --target-dir "$(TARGET)/serial"
	@echo "The program is $(TARGET)/serial/release/dem-mpi"

static:
	@. scripts/environment.sh; unset HDF5_DIR; \
	    if ! { command -v cmake && printf '3.26\n%s\n' "$$(cmake --version | sed -n '1s/.* //p')" | sort -VC; } >/dev/null; then \
	        echo "CMake 3.26 or newer is needed; 'pip install cmake' has it." >&2; exit 1; fi; \
	    cargo build --release --no-default-features --features static-hdf5 $(CARGO_FLAGS) --target-dir "$(TARGET)/static"
	@echo "The program is $(TARGET)/static/release/dem-mpi"
