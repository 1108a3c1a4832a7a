#!/usr/bin/env bash
# Judges pose through the whole program and writes pose_tables.md beside this file: pose.sh BUILD. BUILD:
# where the programs were built; calibrations are kept in BUILD/calibrations, everything else in
# BUILD/pose (some 12 GB).
set -euo pipefail
here=$(dirname "$(readlink -f "$0")")
build=$1
bin=$build/tests/accuracy/whole calibrations=$build/calibrations out=$build/pose results=$build/pose/results
rm -rf "$out" && mkdir -p "$results"
for kind in one_press six_presses lens sphere cylinder; do
  "$here/calibrate.sh" "$build" "$kind" "$calibrations/$kind" >"$out/$kind.log"
done

# judge FOLDER RESULT: with Open3D on the same frames.
judge() {
  /usr/bin/python3 "$here/open3d_icp.py" --every 3 "$1"
  "$bin/pose_judge" "$1" >"$results/$2.csv"
}

"$bin/pose_sequences" --calibration "$calibrations/one_press" --calibration "$calibrations/six_presses" --out "$out"
"$bin/pose_sequences" --calibration "$calibrations/lens" --scene-head "$here/lens_camera.toml" --out "$out"
for kind in sphere cylinder; do
  "$bin/pose_sequences" --calibration "$calibrations/$kind" --scene-head "$here/$kind.toml" --out "$out" \
    --object m4_nut --object cube --object ball_array --object key
done
for kind in one_press six_presses lens sphere cylinder; do
  judge "$out/$kind" "$kind"
done
for motion in minute drag; do
  "$bin/pose_sequences" --calibration "$calibrations/one_press" --out "$out/$motion" --motion "$motion" \
    --object m4_nut --object cube --object m3_long_nut --object key
  judge "$out/$motion/one_press" "$motion"
done
"$bin/pose_judge" --known "$out/one_press" >"$results/known.csv"
/usr/bin/python3 "$here/pose_page.py" "$results" "$here/pose_tables.md"
