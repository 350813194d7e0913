# SPDX-License-Identifier: LGPL-2.1-or-later
# parent_bench with two small views: what it prints, what it writes, what it says to bad input.

bench=${RANGECAST_BUILD:-$source_dir/build}/tests/bench
PATH="$bench:$PATH"
