#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# README's two commands in fresh Debian systems, with the committed tree as `meson dist` packs it. Needs root, debootstrap, and
# for each system 8 GB and about an hour on two cores.
# usage: distributions.sh [SUITE...]   (default: bookworm trixie)
set -euo pipefail
cd "$(dirname "$0")/.."
[ "$(id -u)" = 0 ] && command -v debootstrap >/dev/null || { echo "distributions.sh: needs root and debootstrap" >&2; exit 1; }
# Mounts end with this process.
[ -n "${RANGECAST_MOUNTS:-}" ] || RANGECAST_MOUNTS=private exec unshare --mount "$0" "$@"
[ $# -gt 0 ] || set -- bookworm trixie

status=0
for suite; do
  root=$(mktemp -d "${TMPDIR:-/var/tmp}/$suite.XXXXXX")
  echo "$suite: $root, removed if all is well"
  debootstrap --variant=minbase "$suite" "$root" >"$root/debootstrap.log" || { tail "$root/debootstrap.log"; exit 1; }
  mkdir "$root/srv/gst-rangecast"
  printf '127.0.0.1 localhost\n::1 localhost\n' >"$root/etc/hosts" # as Debian's installer does
  git archive HEAD | tar -x -C "$root/srv/gst-rangecast"
  mount --bind "$root" "$root" # `ip netns exec` wants a mount point as root
  for folder in dev proc sys; do mount --rbind "/$folder" "$root/$folder"; done
  if chroot "$root" env -i HOME=/root PATH=/usr/sbin:/usr/bin:/sbin:/bin LANG=C.UTF-8 \
    bash -c 'cd /srv/gst-rangecast && time ./pipelines/demo.sh && time ./tests/run.sh' 2>&1 | tee "$root/srv/tests.log"; then
    umount --recursive --lazy "$root"
    rm -r --one-file-system "$root"
  else
    status=1
    echo "$suite: failed; the log is $root/srv/tests.log"
  fi
done
exit $status
