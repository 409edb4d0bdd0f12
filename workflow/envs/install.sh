#!/bin/sh
# Install the lock, and this project as it stands, into the environment of $PYTHON.
#
# Wheels only, so that no compiler is needed. Two packages under Snakemake are built here:
# connection-pool is published as source only, and immutables has no wheels for the newest Python;
# its C part is optional, and with CC=true, which compiles nothing, its Python part serves.
#
# uv takes a tenth of pip's time. Of pip's configuration it gets the index only: where it fails,
# pip installs the same lock.
set -eu
python="${PYTHON:-python}"
export PIP_QUIET=1 PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_USER=0
export UV_HTTP_RETRIES=1 UV_HTTP_CONNECT_TIMEOUT=5 UV_HTTP_TIMEOUT=15

install() {
    "$@" --require-hashes -r requirements-build.lock &&
        CC=true "$@" --require-hashes --no-build-isolation --only-binary=:all: \
            --no-binary=connection-pool --no-binary=immutables -r requirements.lock &&
        "$@" --no-deps --no-build-isolation --editable .
}

count=$(sed -n 's/==.*//p' requirements.lock | sort -u | wc -l)
echo "installing $count packages: ten seconds with uv, a minute or two with pip"
index="${PIP_INDEX_URL:-$("$python" -m pip config get global.index-url 2>/dev/null || true)}"
[ -z "$index" ] || export UV_DEFAULT_INDEX="${UV_DEFAULT_INDEX:-$index}"
why="it could not be installed"
if "$python" -m pip install --require-hashes --only-binary=:all: -r requirements-uv.lock &&
    why=$(install "$python" -m uv pip install --quiet --python "$python" 2>&1); then
    exit
fi
echo "pip installs in place of uv, which failed: $(printf %s "$why" | tr -s '[:space:]' ' ')" >&2
install "$python" -m pip install
