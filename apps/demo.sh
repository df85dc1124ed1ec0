#!/bin/sh
# Installs what is missing, builds Nephroid and renders a caustic: sh apps/demo.sh
set -eu
cd "$(dirname "$0")/.."

sh apps/setup.sh
echo "demo: building (first time: a few minutes)"
cmake --preset release -DNEPHROID_TESTS=OFF >/dev/null
cmake --build build/release --target render

mkdir -p build/demo
echo "demo: rendering scenes/ring.glb, at most 50 s"
build/release/bin/render --time 50 --spp 1024 --size 960x720 \
    -o build/demo/ring.exr -o build/demo/ring.png --stats build/demo/ring.json scenes/ring.glb
echo "demo: a metal ring on a floor under a point light; the bright curve inside the ring is its caustic"
echo "  $(pwd)/build/demo/ring.exr   32-bit float"
echo "  $(pwd)/build/demo/ring.png   tone-mapped, to look at"
echo "  $(pwd)/build/demo/ring.json  statistics"
