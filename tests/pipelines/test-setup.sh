# SPDX-License-Identifier: LGPL-2.1-or-later
# What setup.sh, env.sh and the application example say before everything is installed and built.

build=${RANGECAST_BUILD:-$source_dir/build}

# A tree with setup.sh whose build has three parts: meson only writes build.ninja, and all packages count as installed. The third
# part fails if $FAIL is set.
make_tree () {
  mkdir -p tree/bin
  cp "$source_dir/setup.sh" tree
  cat >tree/build.ninja <<'END'
rule compile
  command = echo "$out: a warning" && test -z "$$FAIL" && touch $out
  description = Compiling $out
build part1: compile
build part2: compile
build part3: compile part2
build demo: phony part1 part2
build all: phony part1 part2 part3
END
  printf '#!/bin/sh\nmkdir -p build\ncp build.ninja build\n' >tree/bin/meson
  printf '#!/bin/sh\necho installed\n' >tree/bin/dpkg-query
  chmod +x tree/bin/*
}

run_setup () { PATH=$PWD/tree/bin:$PATH tree/setup.sh "$@"; }
export -f run_setup

test_setup_says_that_it_builds () {
  make_tree
  FAIL=1 expect_error "part1: a warning" run_setup
  FAIL=1 expect_error "tree/build/setup.log" run_setup
  run_setup --demo >setup.txt
  grep -q "building.*build/setup.log" setup.txt || fail "$(cat setup.txt)"
  ! grep -q "a warning" setup.txt || fail "the compiler's output: $(cat setup.txt)"
  grep -q "part2: a warning" tree/build/setup.log || fail "$(cat tree/build/setup.log)"
  [ -e tree/build/part2 ] && [ ! -e tree/build/part3 ] || fail "not the target demo"
  run_setup --demo >setup.txt
  [ ! -s setup.txt ] || fail "nothing to build: $(cat setup.txt)"
  rm tree/build/part1
  NINJA_STATUS=x PATH=$PWD/tree/bin:$PATH script -qec tree/setup.sh /dev/null >terminal.txt
  grep -q "2 of 2" terminal.txt || fail "no progress in a terminal: $(cat terminal.txt)"
}

test_setup_and_tests_print_their_usage () {
  make_tree
  run_setup --help | grep -q -- "--web " || fail "no usage of setup.sh"
  "$source_dir/tests/run.sh" --help | grep -q -- "--fast " || fail "no usage of run.sh"
  [ ! -e tree/build ] || fail "built"
}

test_setup_without_rights_prints_the_command_for_an_administrator () {
  make_tree
  printf '#!/bin/sh\n' >tree/bin/dpkg-query
  printf '#!/bin/sh\necho 1000\n' >tree/bin/id
  printf '#!/bin/sh\nexit 1\n' >tree/bin/sudo
  chmod +x tree/bin/*
  expect_error "an administrator can: apt-get install --no-install-recommends gcc g++ " run_setup --cameras
  ! run_setup --cameras >said.txt 2>&1 || fail "no error"
  grep -q "libaravis-dev" said.txt && ! grep -E "valgrind|chromium" said.txt || fail "$(cat said.txt)"
}

test_interrupted_setup_says_nothing () {
  make_tree
  sed -i '2s/echo/touch building; sleep 60; echo/' tree/build.ninja
  local status=0
  set -m # a group of its own, as in a terminal
  run_setup >setup.txt 2>&1 &
  set +m
  until_true test -e tree/build/building
  kill -INT -- -$!
  wait $! || status=$?
  [ "$status" = 130 ] || fail "status $status: $(cat setup.txt)"
  ! grep -q "failed" setup.txt || fail "$(cat setup.txt)"
}

test_setup_waits_for_another_setup () {
  make_tree
  sed -i '2s/echo/sleep 2 \&\& echo/' tree/build.ninja
  run_setup >first.txt &
  local first=$!
  until [ -e tree/build/build.ninja ]; do sleep 0.05; done
  run_setup >second.txt
  wait "$first" || fail "$(cat first.txt)"
  grep -q "waiting for another" second.txt || fail "$(cat second.txt)"
  ! grep -q "building" second.txt || fail "built twice: $(cat second.txt)"
}

test_demo_builds_no_more_than_it_needs () {
  [ -f "$build/build.ninja" ] || skip "not a build folder"
  ninja -C "$build" -t query demo >demo.txt
  grep -q "codec/libgstneighbourcode.so" demo.txt || fail "$(cat demo.txt)"
  grep -q "pipelines/rangecast-run" demo.txt || fail "$(cat demo.txt)"
  ! grep -E "gst/camera|gst/calibration|tests/" demo.txt || fail "$(cat demo.txt)"
}

test_env_says_that_the_build_is_missing_or_incomplete () {
  local say="source tree/pipelines/env.sh" file
  mkdir tree
  ln -s "$pipelines" tree/pipelines
  unset GST_PLUGIN_PATH
  export GST_REGISTRY=$PWD/registry.bin
  ! gst-inspect-1.0 --exists --atleast-version=0.0.0 neighbourcodeenc || skip "an installed gst-rangecast"
  bash -c "$say" 2>said.txt
  [ "$(wc -l <said.txt)" = 1 ] && grep -q "neither built nor installed.*setup.sh" said.txt || fail "$(cat said.txt)"
  mkdir -p tree/build/gst/codec
  bash -c "$say" 2>said.txt
  [ "$(wc -l <said.txt)" = 1 ] && grep -q "incomplete.*setup.sh" said.txt || fail "$(cat said.txt)"
  for file in "$build"/gst/*/*.so "$build"/pipelines/rangecast{,-run}; do
    mkdir -p "$(dirname "tree/build/${file#"$build"}")"
    ln -s "$file" "tree/build/${file#"$build"}"
  done
  bash -c "$say" 2>said.txt
  [ ! -s said.txt ] || fail "a complete build: $(cat said.txt)"
}

test_env_serves_any_shell_python_and_pkg_config () {
  [ -f "$build/lib/gstrange/GstRange-1.0.typelib" ] || skip "no typelib"
  mkdir tree
  ln -s "$pipelines" "$source_dir/lib" "$build" tree
  [ "$(basename "$build")" = build ] || skip "the build folder is not called build"
  cd tree
  local clean="env -i PATH=/usr/bin:/bin HOME=$HOME" shell
  for shell in "dash -eu" "bash -eu" bash; do
    $clean $shell -c '. ./pipelines/env.sh; gst-inspect-1.0 --exists --atleast-version=0.0.0 neighbourcodeenc; rangecast --version >&2; pkg-config --cflags gstrange-1.0
      /usr/bin/python3 -c "from gi import require_version; require_version (\"GstRange\", \"1.0\")
from gi.repository import GstRange; print (GstRange.map_views)"; set' >said.txt 2>error.txt || fail "$shell: $(cat error.txt)"
    grep -q "function map_views" said.txt && grep -q "^-I.*gstrange" said.txt || fail "$shell: $(cat said.txt)"
    ! grep -E '^(rangecast_|root=|[a-z_]+ [(][)])' said.txt || fail "$shell: left something behind"
  done
}

test_python_examples_say_what_they_need () {
  mkdir gi # a PyGObject without typelibs, then none
  echo 'def require_version (name, version): raise ValueError ("Namespace %s not available" % name)' >gi/__init__.py
  local text example
  for text in "Namespace Gst not available" "No module named"; do
    for example in frames frame_source; do
      PYTHONPATH=$PWD expect_error "$text" /usr/bin/python3 "$pipelines/examples/$example.py" recording.rcnc
      ! PYTHONPATH=$PWD /usr/bin/python3 "$pipelines/examples/$example.py" recording.rcnc 2>said.txt || fail "no error"
      [ "$(wc -l <said.txt)" = 1 ] && grep -q "setup.sh" said.txt || fail "$(cat said.txt)"
    done
    echo 'raise ModuleNotFoundError ("No module named gi")' >gi/__init__.py
  done
}
