#!/usr/bin/env bash
# Calibrates the simulated sensor as a user does, through the programs: calibrate.sh BUILD KIND FOLDER.
# BUILD: where the programs were built. FOLDER is kept when it is newer than the programs. KIND:
#   one_press    one press of a ball of 4 mm radius, as ./dev run makes it
#   six_presses  six of the presses that a guided calibration asks for
#   lens         one press through a lens with barrel distortion, measured with a board of pins
#   sphere, cylinder  one_press, plus the surface model of a finger with a radius of 30 mm
set -euo pipefail
source=$(dirname "$(readlink -f "$0")")/../../..
build=$1 kind=$2 folder=$3
calibrate=$build/clients/dtact-calibrate render=$build/hal/sim/dtact-sim-render
[[ $folder -nt $calibrate && $folder -nt $render ]] && exit 0
work=$folder.work
rm -rf "$folder" "$work" && mkdir -p "$work"

# images SCENE FIRST NAME: renders 32 frames.
images() {
  "$render" --scene "$1" --frames "$2:$(($2 + 32))" -o "$work/$3"
}

# depth OPTION...: runs dtact-calibrate depth
depth() {
  "$calibrate" depth --reference "$work/reference" --radius-mm 4.0 --centre 400,300 --crop 580,580 \
    -o "$folder" "$@"
}

ball=$source/config/scenes/calibrate_ball.toml
case $kind in
  one_press)
    images "$ball" 0 reference
    images "$ball" 300 ball
    depth --ball "$work/ball" --mm-per-px 0.0413793
    ;;
  six_presses)
    scene=$source/config/scenes/calibration_presses.toml
    images "$scene" 0 reference
    presses=()
    for first in 234 408 582 762 942 1122; do  # each press is at rest
      images "$scene" "$first" "press$first"
      presses+=(--press "$work/press$first")
    done
    depth "${presses[@]}" --mm-per-px 0.0413793
    ;;
  lens)
    camera=$source/tests/accuracy/whole/lens_camera.toml
    cat "$camera" "$ball" >"$work/ball.toml"
    {
      cat "$camera"
      echo '[[press]]'
      echo 'object = "pin_board"'
      echo 'keys = [{ t = 2.0, x = 0.3, y = -0.2, rotation = 1.5, depth = 0.0 }, { t = 3.0, depth = 0.9 }]'
    } >"$work/board.toml"
    images "$work/board.toml" 0 reference
    images "$work/board.toml" 300 board
    images "$work/ball.toml" 300 ball
    "$calibrate" lens --board-reference "$work/reference" --board "$work/board" -o "$work/lens.toml"
    depth --ball "$work/ball" --lens "$work/lens.toml"
    ;;
  sphere | cylinder)
    "$0" "$build" one_press "$work/flat"
    cp -r "$work/flat" "$folder"
    surface="shape = \"$kind\"\nradius_mm = 30\nair_mm = 20\ngel_mm = 8\nrefraction = 1"
    [[ $kind == cylinder ]] && surface+="\naxis_deg = 0"
    sed -i "s/^\[surface\].*/&\n$surface/" "$folder/calibration.toml"
    ;;
  *)
    echo "calibrate.sh: '$kind' is none of one_press, six_presses, lens, sphere, cylinder" >&2
    exit 2
    ;;
esac
rm -rf "$work"
