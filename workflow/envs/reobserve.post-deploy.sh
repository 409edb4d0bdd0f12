#!/usr/bin/env bash
# Run by Snakemake in the new environment, from the project's folder.
set -eu
python -m pip install --quiet --require-hashes -r requirements-build.lock
python -m pip install --quiet --require-hashes --no-build-isolation \
    --only-binary=:all: --no-binary=connection-pool -r requirements.lock
python -m pip install --quiet --no-deps --no-build-isolation --editable .
