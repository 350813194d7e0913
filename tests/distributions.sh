#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# README's two commands in fresh Debian systems, or the packages: made in one, installed and used in another that has no compiler. Takes
# the last commit. Needs root, debootstrap, and for each system 8 GB and about an hour on two cores.
# usage: distributions.sh [--packages] [SUITE...]   (default: bookworm trixie)
set -euo pipefail
cd "$(dirname "$0")/.."
[ "$(id -u)" = 0 ] && command -v debootstrap >/dev/null || { echo "distributions.sh: needs root and debootstrap" >&2; exit 1; }
# Mounts end with this process.
[ -n "${RANGECAST_MOUNTS:-}" ] || RANGECAST_MOUNTS=private exec unshare --mount "$0" "$@"
test=readme
[ "${1:-}" != --packages ] || { test=packages; shift; }
[ $# -gt 0 ] || set -- bookworm trixie

make_root () { # suite -> root
  root=$(mktemp -d "${TMPDIR:-/var/tmp}/$1.XXXXXX")
  echo "$1: $root, removed if all is well"
  debootstrap --variant=minbase "$1" "$root" >"$root/debootstrap.log" || { tail "$root/debootstrap.log"; return 1; }
  printf '127.0.0.1 localhost\n::1 localhost\n' >"$root/etc/hosts" # as Debian's installer does
  mount --bind "$root" "$root" # `ip netns exec` wants a mount point as root
  for folder in dev proc sys; do mount --rbind "/$folder" "$root/$folder"; done
}
remove_root () {
  umount --recursive --lazy "$root"
  rm -r --one-file-system "$root"
}
# Runs the standard input there.
in_root () {
  chroot "$root" env -i HOME=/root PATH=/usr/sbin:/usr/bin:/sbin:/bin LANG=C.UTF-8 DEBIAN_FRONTEND=noninteractive bash -exc "$(cat)" </dev/null
}

readme () { # suite
  make_root "$1"
  mkdir "$root/srv/gst-rangecast"
  git archive HEAD | tar -x -C "$root/srv/gst-rangecast"
  in_root <<<'cd /srv/gst-rangecast; time ./pipelines/demo.sh; time ./tests/run.sh'
  remove_root
}
packages () { # suite
  local made
  made=$(mktemp -d)
  make_root "$1"
  git clone --quiet --depth 1 "file://$PWD" "$root/srv/gst-rangecast"
  in_root <<'END'
cd /srv/gst-rangecast
apt-get update -qq
apt-get install -qq --no-install-recommends git ca-certificates dpkg-dev gobject-introspection >/dev/null
apt-get build-dep -qq ./pipelines >/dev/null
meson setup build -Dtests=disabled -Dbenchmarks=disabled >/dev/null
git config --global --add safe.directory "$PWD"
./pipelines/make-packages.sh /srv/packages
END
  cp "$root"/srv/packages/*.deb "$root"/srv/gst-rangecast/pipelines/examples/{head.rcnc,points.c} "$made"
  remove_root
  make_root "$1"
  cp "$made"/* "$root/srv"
  in_root <<'END'
cd /srv
apt-get update -qq
apt-get install -qq --no-install-recommends ./*.deb >/dev/null
rangecast --version
rangecast demo --no-video --frames 60 --out demo
rangecast convert head.rcnc head.ply
python3 -c "import gi; gi.require_version('GstRange', '1.0'); from gi.repository import GstRange; print(GstRange)"
apt-get install -qq --no-install-recommends gcc libc6-dev pkg-config >/dev/null
gcc points.c -o points $(pkg-config --cflags --libs rangecast-1.0) -lm
./points head.rcnc points.ply
ls -l demo head.ply points.ply
END
  remove_root
  rm -r "$made"
}

status=0
for suite; do
  set +e # errexit would not work in a function whose status is looked at
  (set -e && "$test" "$suite")
  [ $? = 0 ] && echo "$suite: passed" || { echo "$suite: failed"; status=1; }
done
exit $status
