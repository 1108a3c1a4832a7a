#!/usr/bin/env bash
# Reproduces the accuracy figures of tests/MEASURED.md on real images and its picture of a
# nut with the release programs, as a user would. Real images are read from ../shared/data beside the
# repository, where they are.
set -euo pipefail
cd "$(dirname "$0")/../.."
bin=build/bin out=build/figures
rm -rf "$out" && mkdir -p "$out"

# evaluate SENSOR: measures the lens on the press of a board of pins, calibrates through it on a press
# of a 4 mm ball and judges both, and writes a page of pictures.
evaluate() {
  local images=../shared/data/$1
  echo "== $1, real images"
  if [[ ! -d $images ]]; then
    echo "skipped: $images is not there"
    return
  fi
  build/dev/tests/accuracy/real/evaluate_folder "$images" "$out/$1"
}
evaluate sensor_a
evaluate sensor_b
evaluate sensor_c

# imported SENSOR: every step of a user who has a folder in that format.
imported() {
  local images=../shared/data/$1
  [[ -d $images ]] || return 0
  echo "== $1, real images, imported"
  "$bin/dtact-calibrate" import "$images" -o "$out/$1_imported"
}
imported sensor_a
imported sensor_b

# raw SENSOR MM_PER_PX: the same ball on the unrectified frame, without a lens.
raw() {
  local images=../shared/data/$1
  [[ -d $images ]] || return 0
  echo "== $1, real images, without a lens ($2 mm/px)"
  "$bin/dtact-calibrate" depth --reference "$images/ball_reference.png" \
    --ball "$images/ball.png" --radius-mm 4.0 --mm-per-px "$2" -o "$out/$1_raw"
  "$bin/dtact-calibrate" evaluate --calibration "$out/$1_raw" --reference "$images/ball_reference.png" \
    --ball "$images/ball.png" --radius-mm 4.0
}
raw sensor_a 0.0510
raw sensor_b 0.05317

echo "== pictures, simulated sensor"
scene=config/scenes/calibrate_ball.toml
"$bin/dtact-sim-render" --scene "$scene" --frames 0:32 -o "$out/reference"
"$bin/dtact-sim-render" --scene "$scene" --frames 300:332 -o "$out/ball"
"$bin/dtact-calibrate" depth --reference "$out/reference" --ball "$out/ball" --radius-mm 4.0 \
  --mm-per-px 0.0413793 --centre 400,300 --crop 580,580 -o "$out/simulated"
# Frame 540 of the built-in scene: an M4 nut pressed 0.9 mm deep.
"$bin/dtact-sim-render" --frames 540 -o "$out/nut.png"
"$bin/dtact-calibrate" apply --calibration "$out/simulated" --reference "$out/reference" \
  --frame "$out/nut.png" -o tests/accuracy/m4_nut.png
echo "pictures: $out/sensor_*/index.html, tests/accuracy/m4_nut.png"
