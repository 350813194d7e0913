#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Makes the source tarball and Debian packages from it. usage: make-packages.sh OUT-DIR
# The tarball holds the last commit. What the packages contain: pipelines/debian.
set -euo pipefail
die () { echo "make-packages.sh: $*" >&2; exit 2; }
case "${1:-}" in
  -h | --help) sed -n '3,4s/^# //p' "$0"; exit 0 ;;
  -*) die "unknown option '$1'; usage: make-packages.sh OUT-DIR" ;;
esac
[ $# = 1 ] || die "give one argument, the folder for the packages"
mkdir -p "$1" 2>/dev/null || die "$1: cannot create this folder"
out=$(realpath "$1")
cd "$(dirname "$0")/.."
[ -f build/build.ninja ] || die "no build here: run ./setup.sh first"
for tool in dpkg-buildpackage dh dh_girepository; do
  command -v $tool >/dev/null || die "no $tool: apt-get install dpkg-dev debhelper gobject-introspection"
done

# meson says where it writes, but not what the tarball is called.
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
name=$(meson introspect --projectinfo build | python3 -c 'import json, sys; p = json.load(sys.stdin); print(p["descriptive_name"] + "-" + p["version"])')
meson dist -C build --no-tests --formats xztar >"$folder/dist.log" 2>&1 || { tail -n 20 "$folder/dist.log" >&2; die "meson dist failed"; }
tar -C "$folder" -xf "build/meson-dist/$name.tar.xz"
cp "build/meson-dist/$name.tar.xz" "$out"

tree=$folder/$name
cp -r "$tree/pipelines/debian" "$tree/debian"
cp "$tree/LICENSE" "$tree/debian/copyright"
cat >"$tree/debian/changelog" <<END
gst-rangecast (${name##*-}) unstable; urgency=medium

  * See CHANGELOG.md.

 -- gst-rangecast developers <gst-rangecast@gst-rangecast.invalid>  $(git log -1 --format=%aD)
END
(cd "$tree" && dpkg-buildpackage --build=binary --no-sign) >"$out/build.log" 2>&1 ||
  { tail -n 30 "$out/build.log" >&2; die "dpkg-buildpackage failed; the whole log is $out/build.log"; }
rm -f "$folder"/*-dbgsym_*.deb
mv "$folder"/*.deb "$out"
ls "$out"
