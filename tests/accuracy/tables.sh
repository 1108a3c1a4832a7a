#!/usr/bin/env bash
# Makes the tables, plots and pages beside this file from the simulated sensor:
# tables.sh BIN [table|objects|model|atlas|thickness|study|whole ...], all of them without a name. BIN: where the accuracy
# tests were built.
set -euo pipefail
here=$(dirname "$(readlink -f "$0")")
bin=$1
shift
(($#)) || set -- table objects model atlas thickness study whole
for part in "$@"; do
  case $part in
    table)
      "$bin/table/paper_table" --out "$here/table"
      ;;
    objects)
      "$bin/model/model_objects" --out "$here/model"
      ;;
    model)
      "$bin/model/model_study" --out "$here/model"
      ;;
    atlas)
      "$bin/atlas/stability_atlas" --out "$here/atlas" >/dev/null
      /usr/bin/python3 "$here/atlas/page.py" "$here/atlas/atlas.csv" "$here/atlas"
      echo "atlas: tests/accuracy/atlas/README.md"
      ;;
    thickness)
      "$bin/thickness/gel_thickness" --out "$here/thickness" >/dev/null
      "$bin/thickness/several_presses" --out "$here/thickness"
      /usr/bin/python3 "$here/thickness/plot.py" "$here/thickness/thickness.csv" "$here/thickness/thickness.svg"
      echo "thickness: tests/accuracy/thickness/thickness.svg"
      ;;
    study)
      "$bin/study/robot_study" --out "$here/study" >/dev/null
      echo "study: tests/accuracy/study/study.md"
      ;;
    whole)
      "$here/whole/pose.sh" "$bin/../.."
      "$bin/whole/whole_random_scenes" --work "$bin/whole/random" --out "$here/whole"
      /usr/bin/python3 "$here/whole/worst.py" "$bin/whole/random/maps" "$here/whole/worst.png"
      echo "whole: tests/accuracy/whole/README.md"
      ;;
    *)
      echo "tables.sh: '$part' is none of table, objects, model, atlas, thickness, study, whole" >&2
      exit 2
      ;;
  esac
done
