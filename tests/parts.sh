# shellcheck shell=bash
# The parts of `./dev test`, which sources this file and has the lists of packages.
# shellcheck disable=SC2154

# part NAME COMMAND...: runs a part of the tests and prints its time.
# The others run after a failed part, and end_of_parts fails for it. A part that passed is
# recorded in build/passed with a digest of the files that it reads, so that --resume need not repeat it: all
# but those that $unread names. A part that cannot run on this machine ends with $skipped.
skipped=77
unread=()
failed_parts=()
skipped_parts=()
resume=0
part() {
  local name=$1 began=$SECONDS status=0 passed=build/passed/$1 tree
  shift
  tree=$(tree_digest)
  if ((resume)) && [[ -e $passed && $(<"$passed") == "$tree" ]]; then
    echo "dev: $name passed on these very files before"
    return
  fi
  # In `( … ) || …` the shell would continue after a command that fails inside.
  set +e
  (set -e; "$@")
  status=$?
  set -e
  local verdict=''
  if ((status == 0)); then
    mkdir -p build/passed
    echo "$tree" >"$passed"
  elif ((status == skipped)); then
    skipped_parts+=("$name")
    verdict=' and was skipped, see above'
  else
    rm -f "$passed"
    failed_parts+=("$name")
    verdict=' and FAILED'
  fi
  echo "dev: $name took $((SECONDS - began)) s$verdict"
}

# A digest of the files of the tree as git sees it, including uncommitted changes, but without those that
# $unread names and the page of the tests' measurements.
tree_digest() {
  git ls-files -z --cached --others --exclude-standard -- . "${unread[@]/#/:!}" ':!tests/MEASURED.md' \
    | { xargs -0 sha256sum 2>&1 || true; } | sha256sum
}

end_of_parts() {
  ((${#skipped_parts[@]} == 0)) || printf 'dev: skipped: %s\n' "${skipped_parts[@]}"
  ((${#failed_parts[@]} == 0)) && return
  printf 'dev: failed: %s\n' "${failed_parts[@]}" >&2
  exit 1
}

test_dev() {
  build_preset dev
  # A guest waits for much of its time: one test more than processors. Daemons have to keep pace with
  # the camera, so nothing that computes for minutes runs beside them.
  ctest --test-dir build/dev --output-on-failure -LE 'e2e|long' -j"$(($(nproc) + 1))"
  ctest --test-dir build/dev --output-on-failure -L e2e -j"$(nproc)"
}

# Accuracy tests of a minute and more.
test_long() {
  build_preset dev
  ctest --test-dir build/dev --output-on-failure -L long -j"$(nproc)"
}

# The unit tests and the checks of the structure, for the time between two edits.
test_quick() {
  build_preset dev daemon/all clients/all tests/unit/all
  ctest --test-dir build/dev --output-on-failure -L unit -E '^(fuzz_|bench_|soak_|web_decoders)' -j"$(nproc)"
}

check_format() {
  sources | xargs clang-format-19 --dry-run --Werror
  git ls-files '*.sh' | xargs shellcheck dev .ci/run debian/*.{postinst,postrm,prerm} tests/kernel/{umlrun,selftest,guest-init} \
    tests/install/guest/{dtact-test,initrd-init}
}

# All tests but those without code of their own: an end-to-end test's deadlines do not hold with two at a
# time, and the accuracy tests run the code of the unit tests on more images, longer than all others together.
# The guest kernel has no memory for the sanitizers' shadows.
test_addresses() {
  build_preset asan-ubsan hal/all daemon/all clients/all tests/{unit,fuzz,e2e,soak}/all bench_tests
  ctest --test-dir build/asan-ubsan --output-on-failure -L unit -E '^python_test$' -j"$(nproc)"
  ctest --test-dir build/asan-ubsan --output-on-failure -LE 'unit|kernel|accuracy|web'
}

# The tests of what has more than one thread. A live session is too slow. Under this sanitizer protobuf's maps
# have another layout than in Debian's library, so code that reads Foxglove's JSON cannot run.
test_threads() {
  local unit=({announce,app,base,client,ctl,live,metrics,net,net_security,perceive}_test
    pipeline_{parts_,heartbeat_,malloc_,}test sim_camera_test v4l2_test ws2812_test)
  local whole=(e2e_{calibration,clients,exposure,hostile,metrics,perceive,record,reload,secure,stream,watchdog}_test)
  local names="${unit[*]} ${whole[*]} e2e_gateway"
  build_preset tsan daemon/all clients/all "${unit[@]}" "${whole[@]}"
  ctest --test-dir build/tsan --output-on-failure -L unit -R "^(${names// /|})\$" -j"$(nproc)"
  ctest --test-dir build/tsan --output-on-failure -L e2e -R "^(${names// /|})\$"
}

# Packages as users get them, and the same bytes from another place.
test_compiled_packages() {
  tests/packages/build.sh build/packages
  /usr/bin/python3 -B tests/packages/contents_test.py build/packages
  tests/packages/lintian.sh build/packages
  tests/packages/reproducible.sh build/packages
}

test_platform() {
  "tests/platform/$1.sh" "${build_packages[@]}" "${test_packages[@]}" "${package_packages[@]}"
}

# test_installed OPTION...: packages in a Debian that boots with systemd.
test_installed() {
  tests/install/run.py "$@"
}

run_tests() {
  local all=0
  case "$*" in
    '') ;;
    --quick)
      need "${build_packages[@]}" "${test_packages[@]}"
      test_quick
      return
      ;;
    --all) all=1 ;;
    '--all --resume') all=1 resume=1 ;;
    *) echo "dev: test does not know '$*'; see ./dev --help" >&2; exit 2 ;;
  esac
  need "${build_packages[@]}" "${test_packages[@]}" "${package_packages[@]}" lintian
  part 'the dev build and its tests' test_dev
  if ((!all)); then
    end_of_parts
    return
  fi

  need "${all_packages[@]}"
  part 'the long accuracy tests' test_long
  part 'the format' check_format
  # Nothing is compiled: clang-tidy reads what the dev build was compiled with.
  part clang-tidy tests/tidy.py build/dev
  unread=('*.md' tests/{accuracy,install,kernel,packages,platform,recognition,web})
  part 'the address and undefined-behaviour sanitizers' test_addresses
  part 'the thread sanitizer' test_threads
  unread=('*.md' tests/{install,kernel,web})
  part 'the packages, built twice' test_compiled_packages
  part 'Debian 13' test_platform debian13
  part arm64 test_platform arm64
  part "Debian 13's packages for arm64" run_package --debian 13 --arch arm64
  unread=('*.md' tests/{accuracy,bench,e2e,fuzz,recognition,soak,unit,web})
  # From the packages of the part above: users install these, not the dev build's.
  part 'installation, faults and power cuts' test_installed --all --cuts 20 --packages build/packages
  # From the packages of the part "Debian 13".
  part 'installation on Debian 13' test_installed --suite trixie --all \
    --packages "build/dev/packages-debian13-$(dpkg --print-architecture)"
  # From the packages of the parts for arm64.
  part 'installation on arm64' test_installed --architecture arm64 --all
  part 'installation on Debian 13 for arm64' test_installed --architecture arm64 --suite trixie --all \
    --packages build/packages-debian13-arm64
  end_of_parts
  echo "dev: all$( ((${#skipped_parts[@]})) && echo ' others') passed in $SECONDS s"
}
