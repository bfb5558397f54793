#!/bin/sh
# Create the virtual environment $1 and install polhode with its pinned dependencies.
# A failed attempt leaves nothing behind.
set -eu
venv=$1

good() {
    command -v "$1" >/dev/null 2>&1 &&
        "$1" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 14))' 2>/dev/null
}

python=${PYTHON:-}
if [ -n "$python" ]; then
    good "$python" || { echo "polhode: PYTHON=$python is not a Python 3.11 to 3.14" >&2; exit 1; }
else
    for candidate in python3.14 python3.13 python3.12 python3.11 python3 python; do
        if good "$candidate"; then python=$candidate; break; fi
    done
fi
if [ -z "$python" ]; then
    echo "polhode: needs Python 3.11 to 3.14; found $(python3 --version 2>/dev/null || echo no python3)." >&2
    echo "polhode: install one (Debian: apt install python3 python3-venv) or say PYTHON=/path/to/python3.12." >&2
    exit 1
fi
if ! "$python" -c 'import venv, ensurepip' 2>/dev/null; then
    echo "polhode: $python has no 'venv' or 'ensurepip' (Debian: apt install python3-venv)." >&2
    exit 1
fi

trap 'rm -rf "$venv"' EXIT
trap 'exit 130' INT TERM
rm -rf "$venv"
echo "polhode: setting up $venv with $("$python" --version); this takes a minute or two" >&2
"$python" -m venv "$venv"
pip() { "$venv/bin/python" -m pip --quiet --disable-pip-version-check install --no-compile --no-deps "$@"; }
# Each file is the one that requirements.txt gives a hash of; polhode itself is built by the setuptools among them.
pip --require-hashes --requirement requirements.txt
pip --no-build-isolation --editable .
# A folder named polhode beside the clone's parent would be found before the clone itself.
for packages in "$venv"/lib/python*/site-packages; do echo "$PWD/typings" > "$packages/polhode-clone.pth"; done
# On all cores, and without the libraries' own tests: half as long as by pip. What does not compile does so on import.
"$venv/bin/python" -m compileall -q -j 0 -x '/tests/' "$venv/lib" >/dev/null || true
trap - EXIT
echo "polhode: ready: $venv/bin/polhode --help lists the commands" >&2
