#!/usr/bin/env bash
# calibrations.sh BUILD OUT: two calibrations of the simulated sensor, OUT/old and OUT/new, made by the
# programs in the build folder BUILD. Kept until those change.
set -euo pipefail
build=$1 out=$2
scene=$(dirname "$0")/../../config/scenes/calibrate_ball.toml
calibrate=$build/clients/dtact-calibrate
[ -e "$out/new/calibration.toml" ] && [ "$out/new" -nt "$calibrate" ] && exit 0
rm -rf "$out"
mkdir -p "$out/frames"
"$build/hal/sim/dtact-sim-render" --scene "$scene" --frames 0:16 -o "$out/frames/old-reference"
"$build/hal/sim/dtact-sim-render" --scene "$scene" --frames 16:32 -o "$out/frames/new-reference"
"$build/hal/sim/dtact-sim-render" --scene "$scene" --frames 200:216 -o "$out/frames/old"
"$build/hal/sim/dtact-sim-render" --scene "$scene" --frames 216:232 -o "$out/frames/new"
for name in old new; do
  "$calibrate" depth --reference "$out/frames/$name-reference" --ball "$out/frames/$name" --radius-mm 4.0 \
    --mm-per-px 0.0413793 --centre 400,300 --crop 580,580 -o "$out/$name" > /dev/null
done
rm -r "$out/frames"
cmp -s "$out/old/calibration.toml" "$out/new/calibration.toml" && echo "$0: two times the same" && exit 1
exit 0
