#!/bin/sh
# Installs what is missing, builds, and runs every test: sh tests/run.sh
#
# 1. unit, statistical and command-line tests of the optimised build, with the comparison against Mitsuba 3
# 2. the tests of everything that reads files, of the path-cut search and of the cache's look-up, and small renders, under address and undefined-behaviour sanitizers
set -eu
cd "$(dirname "$0")/.."

sh apps/setup.sh --tests

venv=build/mitsuba
if [ ! -x $venv/bin/python ] || ! $venv/bin/python -c "import mitsuba, numpy" 2>/dev/null; then
    echo "tests: installing Mitsuba 3 into $venv"
    python3 -m venv $venv
    if ! $venv/bin/pip install -q -r tests/mitsuba/requirements.txt; then
        echo "tests: Mitsuba could not be installed with pip; check the network" >&2
        exit 1
    fi
fi

echo "tests: building"
cmake --preset release -DNEPHROID_TESTS=ON "-DNEPHROID_MITSUBA_PYTHON=$(pwd)/$venv/bin/python" >/dev/null
cmake --build build/release
cmake --preset asan -DNEPHROID_TESTS=ON >/dev/null
cmake --build build/asan --target nephroid_tests render

echo "tests: sanitizers"
ctest --test-dir build/asan --output-on-failure
echo "tests: optimised build"
ctest --test-dir build/release --output-on-failure
