#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# The table of tests/bench/results/copies.md: allocations and bytes copied per frame set, by element, in the steady state. Each pipeline
# runs with N and 2N frame sets, without and with the element; what is given is the difference.
# usage: copies.sh [FRAMES]   (default: 20)
# Needs valgrind (dhat) and a C compiler.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
source "$here/arguments.sh"
source "$here/../../pipelines/env.sh"
need_arguments 0 1 "$@"
frames=${1:-20}
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT

# Bytes of all calls of memcpy() and memmove() with 64 bytes or more.
cat >"$dir/count.c" <<'C'
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
static _Atomic uint64_t copied;
void *memmove (void *to, const void *from, size_t n) {
  uint8_t *t = to;
  const uint8_t *f = from;
  if (n >= 64)
    copied += n;
  if (t > f && t < f + n) {
    while (n--)
      t[n] = f[n];
    return to;
  }
  __asm__ volatile ("rep movsb" : "+D"(t), "+S"(f), "+c"(n) : : "memory");
  return to;
}
void *memcpy (void *to, const void *from, size_t n) { return memmove (to, from, n); }
__attribute__ ((destructor)) static void tell (void) { fprintf (stderr, "copied %llu\n", (unsigned long long) copied); }
C
cc -shared -fPIC -O2 -fno-builtin -o "$dir/count.so" "$dir/count.c"

record () { # FILE FRAMES PROPERTIES...
  gst-launch-1.0 -q avatartestsrc views=4 "num-buffers=$(($2 + 20))" empty-frames=20 "${@:3}" ! video/x-range,width=320,height=240 \
    ! roiextract background-frames=18 ! neighbourcodeenc profile=plain ! filesink "location=$1"
}
for n in "$frames" $((2 * frames)); do
  record "$dir/all-$n.rcnc" "$n"
  for id in 0 1 2 3; do record "$dir/view-$id-$n.rcnc" "$n" "view-id=$id"; done
done

blocks () { # PIPELINE...
  G_SLICE=always-malloc valgrind --tool=dhat --dhat-out-file=/dev/null gst-launch-1.0 -q "$@" 2>&1 >/dev/null |
    sed -n 's/.*Total: *\([0-9,]*\) bytes in \([0-9,]*\) blocks.*/\2 \1/p' | tail -1 | tr -d ,
}
copied () { LD_PRELOAD=$dir/count.so gst-launch-1.0 -q "$@" 2>&1 >/dev/null | sed -n 's/^copied //p' | tail -1; }

measure () { # PIPELINE with @ for the number of frame sets: blocks, bytes allocated and bytes copied per frame set
  local a b
  # shellcheck disable=SC2086
  a="$(blocks ${1//@/$frames}) $(copied ${1//@/$frames})" b="$(blocks ${1//@/$((2 * frames))}) $(copied ${1//@/$((2 * frames))})"
  paste -d' ' <(echo "$a") <(echo "$b") | awk -v n="$frames" '{ printf "%.2f %.0f %.0f\n", ($4-$1)/n, ($5-$2)/n, ($6-$3)/n }'
}
row () { # NAME WITHOUT WITH
  paste -d' ' <(measure "$2") <(measure "$3") |
    awk -v name="$1" '{ printf "| %s | %.1f | %.1f | %.1f |\n", name, $4-$1, ($5-$2)/1000, ($6-$3)/1000 }'
}

file="filesrc location=$dir/all-@.rcnc ! neighbourcodeparse"
quiet=stats-interval=0 # its messages come by time
mux="rangemux name=m $quiet"
for id in 0 1 2 3; do inputs="${inputs:-} filesrc location=$dir/view-$id-@.rcnc ! neighbourcodeparse ! m."; done
sink="fakesink sync=false"
alone=${inputs//m./$sink}
echo "| element | allocations | KB allocated | KB copied |"
echo "|---|---|---|---|"
decode="neighbourcodedec n-threads=1 $quiet" encode="neighbourcodeenc profile=plain n-threads=1 $quiet"
pay="rtpneighbourcodepay $quiet" depay="rtpneighbourcodedepay $quiet"
row "neighbourcodeenc" "$file ! $decode ! $sink" "$file ! $decode ! $encode ! $sink"
row "neighbourcodeenc, rtpneighbourcodepay" "$file ! $decode ! $sink" "$file ! $decode ! $encode ! $pay ! $sink"
row "neighbourcodeenc, rangemux" "$file ! $decode ! $sink" "$file ! $decode ! $encode ! rangemux $quiet ! $sink"
row "rtpneighbourcodepay" "$file ! $sink" "$file ! $pay ! $sink"
row "rtpneighbourcodedepay" "$file ! $pay ! $sink" "$file ! $pay ! $depay ! $sink"
row "rangemux, 4 coded streams" "$alone" "$mux ! $sink $inputs"
row "neighbourcodedec, one memory" "$file ! $sink" "$file ! $decode ! $sink"
row "neighbourcodedec behind rangemux" "$mux ! $sink $inputs" "$mux ! $decode ! $sink $inputs"
