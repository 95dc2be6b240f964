#!/bin/sh
# Make the virtual environment and install boresight into it, from nothing but Python 3.11.
# Usage: setup.sh PYTHON VENV EXTRAS
set -eu
python=$1 venv=$2 extras=$3

"$python" - <<'PY' || exit 1
import sys

if sys.version_info < (3, 11):
    sys.exit(f"boresight needs Python 3.11 or later; this is {sys.version.split()[0]}. "
             "Say which one to use: make PYTHON=/path/to/python3.11")
PY

make_venv() {
    "$python" -m venv "$venv" >/dev/null 2>&1
}

# Debian keeps the part of venv that brings pip in a package of its own.
if [ ! -x "$venv/bin/python" ] && ! make_venv; then
    rm -rf "$venv"
    if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null 2>&1; then
        echo "setup: installing python3-venv (this Python cannot make environments yet)"
        apt-get update -qq
        DEBIAN_FRONTEND=noninteractive apt-get install -y -qq python3-venv >/dev/null
        make_venv
    else
        echo "setup: '$python -m venv' failed. On Debian and Ubuntu: sudo apt install python3-venv" >&2
        exit 1
    fi
fi

echo "setup: installing boresight and what it needs into $venv (about a minute the first time)"
if command -v uv >/dev/null 2>&1; then
    uv pip install --quiet --python "$venv/bin/python" --editable ".[$extras]"
else
    "$venv/bin/python" -m pip install --quiet --disable-pip-version-check --editable ".[$extras]"
fi
