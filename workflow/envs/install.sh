#!/bin/sh
# Install the lock, and this project as it stands, into the environment of $PYTHON.
#
# Wheels only, so that no compiler is needed. Two packages under Snakemake are built here:
# connection-pool is published as source only, and immutables has no wheels for the newest Python;
# its C part is optional, and with CC=true, which compiles nothing, its Python part serves.
set -eu
pip="${PYTHON:-python} -m pip install --quiet --disable-pip-version-check"
$pip --require-hashes -r requirements-build.lock
CC=true $pip --require-hashes --no-build-isolation \
    --only-binary=:all: --no-binary=connection-pool,immutables -r requirements.lock
$pip --no-deps --no-build-isolation --editable .
