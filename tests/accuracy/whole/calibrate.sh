#!/usr/bin/env bash
# Calibrates the simulated sensor as a user does, through the programs: calibrate.sh BUILD KIND FOLDER.
# BUILD: where the programs were built. KIND: one_press. FOLDER is left as it is when it is newer than
# the programs.
set -euo pipefail
source=$(dirname "$(readlink -f "$0")")/../../..
build=$1 kind=$2 folder=$3
calibrate=$build/clients/dtact-calibrate render=$build/hal/sim/dtact-sim-render
[[ $folder -nt $calibrate && $folder -nt $render ]] && exit 0
work=$folder.work
rm -rf "$folder" "$work" && mkdir -p "$work"
case $kind in
  one_press)
    scene=$source/config/scenes/calibrate_ball.toml
    "$render" --scene "$scene" --frames 0:32 -o "$work/reference"
    "$render" --scene "$scene" --frames 300:332 -o "$work/ball"
    "$calibrate" depth --reference "$work/reference" --ball "$work/ball" --radius-mm 4.0 \
      --mm-per-px 0.0413793 --centre 400,300 --crop 580,580 -o "$folder"
    ;;
  *)
    echo "calibrate.sh: '$kind' is none of one_press" >&2
    exit 2
    ;;
esac
rm -rf "$work"
