#!/bin/sh
# Installs what building and running Nephroid needs on Debian or Ubuntu; does nothing where all is there.
# Usage: sh apps/setup.sh [--tests]     --tests: also what tests/run.sh needs
set -eu

packages="g++ cmake ninja-build pkg-config libembree-dev libopenimageio-dev libopenexr-dev libtinygltf-dev libglm-dev
libtbb-dev libcli11-dev nlohmann-json3-dev libdraco-dev libcgal-dev python3 python3-venv"
if [ "${1:-}" = --tests ]; then
    packages="$packages doctest-dev"
fi

if ! command -v dpkg-query >/dev/null 2>&1 || ! command -v apt-get >/dev/null 2>&1; then
    echo "setup: this is not Debian or Ubuntu (no apt-get); install the equivalents of:" $packages >&2
    exit 1
fi

missing=
for package in $packages; do
    state=$(dpkg-query -W -f '${Status}' "$package" 2>/dev/null || true)
    [ "$state" = "install ok installed" ] || missing="$missing $package"
done
if [ -z "$missing" ]; then
    exit 0
fi

as_root=
if [ "$(id -u)" != 0 ]; then
    if ! command -v sudo >/dev/null 2>&1; then
        echo "setup: missing:$missing; run as root, or install them yourself (there is no sudo here)" >&2
        exit 1
    fi
    as_root=sudo
fi

echo "setup: installing$missing"
$as_root apt-get update -qq || echo "setup: the package lists could not be refreshed; trying with the old ones" >&2
if ! $as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $missing >/dev/null; then
    echo "setup: apt-get could not install:$missing; check the network and that this release has them" >&2
    exit 1
fi
