#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Compiles lib/rangecast's core to WebAssembly, without threads; exit status 77 (skipped) where the compiler is missing.
# Debian: clang-19 lld-19 wasi-libc libc++-19-dev-wasm32 libclang-rt-19-dev-wasm32
# usage: tests/wasm-core.sh [FOLDER OF THE OBJECTS]   (default: one that is removed)
set -euo pipefail
out=${1:-$(mktemp -d)}
[ $# -gt 0 ] || trap 'rm -rf "$out"' EXIT
mkdir -p "$out"
out=$(cd "$out" && pwd)
cd "$(dirname "$0")/.."
compiler=${WASM_CXX:-clang++-19}
flags=(--target=wasm32-wasi -std=c++20 -O1 -Wall -Wextra -ffp-contract=off -fignore-exceptions -Ilib)
command -v "$compiler" >/dev/null && echo '#include <vector>' | "$compiler" "${flags[@]}" -x c++ -fsyntax-only - 2>/dev/null || {
  echo "skipped: $compiler, or its C++ library for wasm32-wasi, is missing"
  exit 77
}

# The core's folders, without what needs a file system or threads.
readarray -t sources < <(find lib/rangecast/{base,geometry,neighbourcode,alignment,overlap,surface,sync} -name '*.cpp' \
  ! -name output_path.cpp ! -name thread_pool.cpp)
export compiler out
printf '%s\0' "${sources[@]}" | xargs -0 -P "$(nproc)" -I{} bash -c \
  'object=$out/$(tr / _ <<<"$1").o; "$compiler" "${@:2}" -c "$1" -o "$object"' - {} "${flags[@]}"
echo "ok: ${#sources[@]} files of core compile to WebAssembly"
