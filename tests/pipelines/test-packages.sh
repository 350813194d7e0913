# SPDX-License-Identifier: LGPL-2.1-or-later
# The Debian packages hold what is installed, each file once.

build=${RANGECAST_BUILD:-$source_dir/build}

# Of every file that meson installs, the packages whose lists name it.
owners () {
  meson introspect --installed "$build" | python3 -c '
import fnmatch, json, pathlib, re, subprocess, sys
folder = pathlib.Path(sys.argv[1])
options = json.loads(subprocess.check_output(["meson", "introspect", "--buildoptions", sys.argv[2]]))
prefix = next(o["value"] for o in options if o["name"] == "prefix").strip("/")
lists = {f.stem if f.suffix == ".install" else f.name: f.read_text().split() for f in folder.glob("*.install")}
for path in sorted(json.load(sys.stdin).values()):
    path = "usr" + path.strip("/").removeprefix(prefix)
    path = re.sub("^usr/lib/python3[.0-9]*/", "usr/lib/python3/", path) # for prefix /usr
    found = [name for name, patterns in lists.items() if any(fnmatch.fnmatch(path, p) or fnmatch.fnmatch(path, p + "/*") for p in patterns)]
    print(path, *found)
' "$pipelines/debian" "$build"
}

test_each_installed_file_is_in_one_package () {
  owners >owners.txt
  [ "$(wc -l <owners.txt)" -gt 20 ] || fail "$(cat owners.txt)"
  ! awk 'NF != 2' owners.txt | grep . || fail "in no package or in several"
}

test_each_list_belongs_to_a_package () {
  local list
  for list in "$pipelines"/debian/*.install; do
    grep -qx "Package: $(basename "$list" .install)" "$pipelines/debian/control" || fail "no package for $list"
  done
}

test_versions_agree () {
  local version
  version=$(meson introspect --projectinfo "$build" | python3 -c 'import json, sys; print(json.load(sys.stdin)["version"])')
  rangecast --version | grep -qF " $version" || fail "rangecast is not $version: $(rangecast --version)"
  grep -qF "\"version\": \"$version\"" "$source_dir/pipelines/web/package.json" || fail "the npm package is not $version"
  [ "$(gst-inspect-1.0 striprender | awk '$1 == "Version" { print $2 }')" = "$version" ] || fail "the plugins are not $version"
  [[ "$(grep -m 1 '^## ' "$source_dir/CHANGELOG.md")" = *"$version"* ]] || fail "CHANGELOG.md does not begin with $version"
}

test_what_is_missing_is_said () {
  expect_error "give one argument" "$pipelines/make-packages.sh"
  expect_error "unknown option '--x'" "$pipelines/make-packages.sh" --x
  touch file
  expect_error "cannot create" "$pipelines/make-packages.sh" file/out
}
