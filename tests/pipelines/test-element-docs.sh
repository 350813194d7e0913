# SPDX-License-Identifier: LGPL-2.1-or-later
# docs/elements: the generated tables are those of the elements, and the launch lines run.
#
# A block of a page that begins with "```sh run" is a shell script. The blocks of a page run in order in one folder, with the
# following changes: a source draws 8 frames, 4 of the empty scene, of which 3 are learnt; sinks that open a window are
# fakesinks; UDP ports and the addresses of fake cameras are this run's own. What a block leaves running in the background ends
# with it.

pages=$source_dir/docs/elements

test_tables_are_those_of_the_elements () {
  /usr/bin/python3 -c 'import gi; exit(gi.version_info >= (3, 50))' || skip "update.py reads enumerations as PyGObject before 3.50 has them"
  RANGECAST_BUILD=${RANGECAST_BUILD:-$source_dir/build} /usr/bin/python3 "$pages/update.py" --check
}

# usage: adapt <script >script
adapt () {
  sed -E -e 's/num-buffers=[0-9]{2,}/num-buffers=8/g' -e 's/\bavatartestsrc\b/avatartestsrc num-buffers=8/g' \
    -e 's/\b(empty-frames=)[0-9]+/\14/g; s/\b(background-frames=)[0-9]+/\13/g' -e 's/\bvideotestsrc\b/videotestsrc num-buffers=8/g' -e 's/\b(autovideosink|glimagesink)( [a-z-]+=[^ ]+)*/fakesink/g' \
    -e "s/\\bport=500([0-9])\\b/port=$((ports / 10))\\1/g" \
    -e "s/\\bfake-cameras /fake-cameras --address-base 127.$((ports / 256)).$((ports % 256)).1 --size 160x120 /g"
}

# usage: run_page NAME
run_page () {
  local script n=0
  awk -v name="$1" '/^```sh run$/ { n++; inside = 1; next } /^```$/ { inside = 0 } inside { print > sprintf("%s-%02d.sh", name, n) }' \
    "$pages/$1.md"
  for script in "$1"-*.sh; do
    [ -f "$script" ] || fail "$1.md has no block '\`\`\`sh run'"
    { echo "trap 'kill \$(jobs -p) 2>/dev/null || true' EXIT"; adapt <"$script"; } >run.sh
    timeout -k 5 60 bash -e run.sh >log.txt 2>&1 || fail "$script: $(cat "$script"; tail -n 20 log.txt)"
    ! grep -E '^(ERROR|WARNING)|CRITICAL' log.txt >errors.txt || fail "$script: $(cat "$script" errors.txt)"
    n=$((n + 1))
  done
  echo "$1: $n blocks"
}

for page in "$pages"/*.md; do
  name=$(basename "$page" .md)
  ! grep -q '^```sh run$' "$page" && [[ "$name" = *provider ]] && continue
  case $name in
    stereocamsrc) need='need_command fake-cameras' ;;
    rigcalibrate) need='need_boards' ;;
    striprender) need=need_gl ;;
    *) need=: ;;
  esac
  eval "test_launch_lines_of_$name () { $need; run_page $name; }"
done

need_command () { command -v "$1" >/dev/null || skip "no $1"; }

# Photographs of a board, as rigcalibrate.md takes them.
need_boards () {
  local boards=/usr/share/doc/opencv-doc/examples/data
  [ -f "$boards/left01.jpg" ] || skip "no opencv-doc"
  local file n=0
  for file in "$boards"/left[01]?.jpg; do # left10.jpg is missing
    n=$((n + 1))
    cp "$file" "$(printf left%02d.jpg $n)"
    cp "${file/left/right}" "$(printf right%02d.jpg $n)"
  done
}
