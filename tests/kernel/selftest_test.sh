#!/bin/bash
# The self-test's error messages, with programs in place of the guest kernel.
set -u
here=$(cd "$(dirname "$0")" && pwd)
KERNEL_CACHE=$(mktemp -d)
export KERNEL_CACHE
trap 'rm -rf "$KERNEL_CACHE"' EXIT
processor=$(sed -n 's/^model name[[:space:]]*: //p' /proc/cpuinfo | head -n 1)

# expect SENTENCE SCRIPT: with a kernel that is SCRIPT, the self-test fails with one line, SENTENCE.
expect() {
  printf '#!/bin/sh\n%s\n' "$2" > "$KERNEL_CACHE/linux"
  chmod +x "$KERNEL_CACHE/linux"
  local said ended=0
  said=$("$here/selftest" 2>&1) || ended=$?
  [ "$ended $said" = "1 the guest kernel does not run \`true\` on this processor (${processor:-unknown}): $1, all of it is in $KERNEL_CACHE/selftest.log" ] \
    || { echo "expected: $1"; echo "exit code $ended: $said"; exit 1; }
}
expect 'restore_registers - ptrace set fp regs failed, errno = 14; exit code 125' \
  'echo "Linux version 6.1"; echo "restore_registers - ptrace set fp regs failed, errno = 14"
   echo "Kernel panic - not syncing"; exit 134'
expect 'it says nothing; exit code 125' 'exit 0'
echo "as expected"
