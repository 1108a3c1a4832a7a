# shellcheck shell=bash disable=SC2154
# Sourced by the scripts of this folder: a Debian system in a folder, kept from run to run.
#
# Each script sets before sourcing:
#   suite   Debian's release
#   root    the chroot's folder in $CHROOT_CACHE (default ~/.cache/dtactd-chroots)

skip() {
  echo "$(basename "$0"): skipped: $*" >&2
  exit 77
}

source_folder=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)

# inside COMMAND: runs a shell command in the chroot, with /proc and /sys mounted meanwhile.
inside() {
  local page=OFF
  if [ -e "$root/page/index.html" ]; then page=/page; fi
  # shellcheck disable=SC2016  # the inner shell expands it
  unshare --mount bash -c '
    mount -t proc proc "$1/proc"
    mount --rbind /sys "$1/sys"
    mount --rbind /dev "$1/dev"
    exec chroot "$1" /usr/bin/env -i HOME=/root LANG=C.UTF-8 DEBIAN_FRONTEND=noninteractive \
      PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin \
      CCACHE_DIR=/ccache DTACT_WEB_PAGE="$3" bash -euc "$2"' inside "$root" "$1" "$page"
}

# prepare SETUP PACKAGE...: makes the chroot, runs SETUP once in it, installs the packages. Scripts that
# share a chroot each remember what they have installed.
prepare() {
  local setup=$1 stamp installed=$root/installed.${0##*/}
  shift
  [ "$(id -u)" = 0 ] || skip "a chroot needs root: sudo $0"
  command -v debootstrap > /dev/null || skip "run: apt-get install debootstrap"
  mkdir -p "$(dirname "$root")"
  exec 9> "$root.lock"
  flock 9
  if [ ! -e "$root/ready" ]; then
    echo "$(basename "$0"): making a Debian $suite in $root"
    rm -rf "$root"
    debootstrap --variant=minbase "$suite" "$root" > "$root.log" 2>&1 \
      || skip "no Debian $suite can be had: see $root.log"
    touch "$root/ready"
  fi
  cp /etc/resolv.conf "$root/etc/resolv.conf"
  printf '127.0.0.1 localhost\n::1 localhost\n' > "$root/etc/hosts"
  stamp=$(printf '%s\n' "$setup" "$@" | sha256sum | cut -c1-16)
  if [ "$(cat "$installed" 2> /dev/null)" != "$stamp" ]; then
    echo "$(basename "$0"): installing packages"
    inside "$setup
      apt-get update -qq
      apt-get install -y -qq --no-install-recommends $*" >> "$root.log" 2>&1 \
      || { tail -n 20 "$root.log" >&2; exit 1; }
    echo "$stamp" > "$installed"
  fi
}

# copy_source: the tree as git sees it, uncommitted changes included, to /source, and its page to /page.
copy_source() {
  rm -rf "$root/source"
  mkdir -p "$root/source"
  (cd "$source_folder" && git ls-files -z --cached --others --exclude-standard \
    | tar --null --files-from=- --ignore-failed-read -c) | tar -x -C "$root/source"
  # The page is the same everywhere, and built outside: the chroot needs no npm.
  if [ -e "$source_folder/clients/web/page/package.json" ]; then
    "$source_folder/clients/web/build_page.sh" "$source_folder/clients/web/page" "$source_folder" \
      "$root.npm" "$root/page" npm
  fi
}

# package OUT ARCHITECTURE [BUILT]: Debian packages of the source, into the folder OUT, which is emptied.
# With a folder BUILT of programs that `cmake --preset dev` built in the chroot, nothing is compiled. Then checks
# their contents.
package() {
  local out=$1 architecture=$2 built=${3-} options=
  [ -z "$built" ] || options=--no-check-builddeps
  rm -rf "$root/packages" "$out"
  mkdir -p "$root/packages" "$out"
  cp -a "$root/source" "$root/packages/dtactd"
  inside "${built:+export DTACT_BUILT=$built}
    cd /packages/dtactd
    dpkg-buildpackage --build=binary --no-sign $options --host-arch=$architecture > ../build.log 2>&1" \
    || { tail -n 40 "$root/packages/build.log" >&2; exit 1; }
  cp "$root"/packages/*.{deb,changes,buildinfo,log} "$out"
  /usr/bin/python3 -B "$source_folder/tests/packages/contents_test.py" "$out"
}
