#!/usr/bin/env bash
# run.sh FOLDER TESTS: installs the Python packages as they are in this tree into FOLDER and runs the
# unittest files *_test.py of the folder TESTS on them.
#
# Exit code: 0 passed; 77 Debian's packages are missing (they are named); else failed.
set -euo pipefail
mkdir -p "$1"
folder=$(readlink -f "$1")
tests=$(readlink -f "$2")
source=$(readlink -f "$(dirname "$0")/../../../clients/python")
python=/usr/bin/python3

missing=()
for needed in google.protobuf:python3-protobuf numpy:python3-numpy zstandard:python3-zstandard \
  setuptools:python3-setuptools wheel:python3-wheel pip:python3-pip; do
  $python -c "import ${needed%:*}" 2> /dev/null || missing+=("${needed#*:}")
done
if ((${#missing[@]})); then
  echo "skipped: apt-get install ${missing[*]}" >&2
  exit 77
fi

# install INTO OPTION...: as `pip install` from the tree. It is built in a copy: setuptools leaves
# its work beside the sources.
install() {
  local into=$1
  shift
  rm -rf "$folder/source"
  cp -r "$source" "$folder/source"
  $python -m pip --python "$into/bin/python" install -q --no-index --no-deps --no-build-isolation \
    --force-reinstall --disable-pip-version-check --root-user-action=ignore "$@" \
    "$folder/source" "$folder/source/lerobot"
}

exec 9> "$folder/lock"
flock 9
stamp=$(cd "$source" \
  && find . -type f -not -name '*.pyc' -print0 | sort -z | xargs -0 sha256sum | sha256sum)
if [ "$(cat "$folder/stamp" 2> /dev/null)" != "$stamp" ]; then
  rm -rf "$folder/venv"
  $python -m venv --system-site-packages --without-pip "$folder/venv"
  install "$folder/venv"
  echo "$stamp" > "$folder/stamp"
fi
flock -u 9

export MYPY_CACHE=$folder/mypy
cd "$tests"
# protobuf 3.21 itself warns of Python 3.14.
exec "$folder/venv/bin/python" -B -W error -W default::DeprecationWarning \
  -m unittest discover -v -p '*_test.py' -t . -s .
