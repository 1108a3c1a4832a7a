#!/usr/bin/env bash
# Reproduces the accuracy figures and the pictures of README.md with the release programs, as a user
# would. Real images are read from ../shared/data beside the repository, where they are.
set -euo pipefail
cd "$(dirname "$0")/../.."
bin=build/bin out=build/figures
rm -rf "$out" && mkdir -p "$out"

# evaluate SENSOR MM_PER_PX: calibrates on a real press of a 4 mm ball and judges it against the
# sphere, in-sample and with the list of one half of the disc on the other.
evaluate() {
  local images=../shared/data/$1
  echo "== $1, real images (one press of a ball of 4 mm radius, $2 mm/px)"
  if [[ ! -d $images ]]; then
    echo "skipped: $images is not there"
    return
  fi
  "$bin/dtactctl" calibrate depth --reference "$images/ball_reference.png" \
    --ball "$images/ball.png" --radius-mm 4.0 --mm-per-px "$2" -o "$out/$1"
  "$bin/dtactctl" evaluate --calibration "$out/$1" --reference "$images/ball_reference.png" \
    --ball "$images/ball.png" --radius-mm 4.0
  "$bin/dtactctl" reconstruct --calibration "$out/$1" --reference "$images/ball_reference.png" \
    --frame "$images/ball.png" -o "$out/$1_ball.png"
  "$bin/dtactctl" reconstruct --calibration "$out/$1" --reference "$images/board_reference.png" \
    --frame "$images/board.png" -o "$out/$1_board.png"
}
evaluate sensor_a 0.0510
evaluate sensor_b 0.05317

echo "== pictures, simulated sensor"
scene=config/scenes/calibrate_ball.toml
"$bin/dtact-sim-render" --scene "$scene" --frames 0:32 -o "$out/reference"
"$bin/dtact-sim-render" --scene "$scene" --frames 300:332 -o "$out/ball"
"$bin/dtactctl" calibrate depth --reference "$out/reference" --ball "$out/ball" --radius-mm 4.0 \
  --mm-per-px 0.0413793 --centre 300,400 --crop 580,580 -o "$out/simulated"
# Frame 540 of the built-in scene: an M4 nut pressed 0.9 mm deep.
"$bin/dtact-sim-render" --frames 540 -o "$out/nut.png"
"$bin/dtactctl" reconstruct --calibration "$out/simulated" --reference "$out/reference" \
  --frame "$out/nut.png" -o tests/accuracy/m4_nut.png
echo "pictures: $out/*.png, tests/accuracy/m4_nut.png"
