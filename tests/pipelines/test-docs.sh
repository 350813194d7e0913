# SPDX-License-Identifier: LGPL-2.1-or-later
# The documentation's links, and every mention of it in the tree, lead to something that exists; README's launch lines run.

check_docs () { python3 "$source_dir/tests/pipelines/check-docs.py" "$1" 2>&1; }

test_links_and_named_pages_exist () {
  local faults
  faults=$(check_docs "$source_dir") || fail "$faults"
}

# As they stand in README.md, but for a window, which a picture in memory replaces, and an end.
test_launch_lines_of_the_readme_run () {
  local line depths
  awk '/^```/ { inside = !inside; next } inside' "$source_dir/README.md" | sed -e ':a' -e '/\\$/N; s/\\\n//; ta' | grep '^gst-launch-1.0 ' >lines
  [ "$(wc -l <lines)" = 6 ] || fail "expected six launch lines: $(cat lines)"
  sed -i -e 's/is-live=true/num-buffers=5/; s/ autovideosink$/ fakesink/; s/ playbin .*/& video-sink=fakesink/' lines
  while read -r line; do
    timeout 60 bash -c "$line" >launch.log 2>&1 || fail "$line: $(tail -n 5 launch.log)"
    ! grep -q '^WARNING' launch.log || fail "$line: $(cat launch.log)"
  done <lines
  expect_file depth.webm 1000
  # The pictures that one line makes are the next one's input. 8 bits would leave 256 depths.
  [ "$(head -c 26 depth.png | tail -c 2 | od -An -tu1 | tr -s ' ')" = " 16 0" ] || fail "depth.png is not a 16-bit greyscale PNG"
  depths=$(python3 -c '
import struct
header, points = open("cloud.ply", "rb").read().split(b"end_header\n", 1)
count = int(header.split(b"element vertex ")[1].split()[0])
assert b"format binary_little_endian" in header and b"property float x\nproperty float y\nproperty float z\n" in header, header
size = len(points) // count
print(len({struct.unpack_from("<f", points, i * size + 8)[0] for i in range(count)}))')
  [ "$depths" -gt 1000 ] || fail "only $depths different depths"
}

# Sender and receiver of coded frame sets, one after the other.
test_recipes_of_coded_streams_run () {
  local sender receiver sending
  grep -E '^gst-launch-1.0 .*(shm|srt)s' "$source_dir/docs/guide/recipes.md" |
    sed -e "s,/tmp/avatar,$PWD/avatar,; s/ glimagesink/ fakesink num-buffers=10/" >lines
  [ "$(wc -l <lines)" = 4 ] || fail "expected four lines: $(cat lines)"
  while read -r sender && read -r receiver; do
    timeout 60 bash -c "exec $sender" >sender.log 2>&1 &
    sending=$!
    until_true timeout 20 bash -c "$receiver" >receiver.log 2>&1 || fail "$sender: $(tail -n 3 sender.log); $receiver: $(tail -n 3 receiver.log)"
    grep -q 'Got EOS' receiver.log || fail "$(cat receiver.log)"
    kill $sending
    wait $sending || true
  done <lines
}

test_each_page_is_in_the_index () {
  local page missing=
  for page in "$source_dir"/docs/guide/*.md "$source_dir"/docs/formats/*.md "$source_dir"/docs/engineering/*.md; do
    page=${page#"$source_dir"/docs/}
    grep -qF "($page)" "$source_dir/docs/README.md" || missing+=" $page"
  done
  [ -z "$missing" ] || fail "docs/README.md does not link:$missing"
}

test_a_broken_reference_is_found () {
  local docs=docs # so that these are no paths of this tree
  mkdir -p tree/$docs/guide tree/gst
  printf '# One page\n\n[self](#one-page) [other](guide/other.md#a-heading) `gst/there.cpp`\n' >tree/$docs/page.md
  printf '## A heading\n\n```\n[no link](nowhere.md)\n```\n' >tree/$docs/guide/other.md
  echo "/* see $docs/page.md and $docs/guide/ and $docs/guide/*.md */" >tree/gst/there.cpp
  [ "$(check_docs tree)" = "" ] || fail "$(check_docs tree)"
  expect_fault () { # text
    [[ "$(check_docs tree)" == *"$1"* ]] || fail "expected '$1': $(check_docs tree)"
  }
  echo '[gone](gone.md)' >tree/$docs/guide/link.md
  expect_fault "$docs/guide/link.md: link to gone.md: no such file"
  echo '[gone](../page.md#two-pages)' >tree/$docs/guide/link.md
  expect_fault "$docs/guide/link.md: link to ../page.md#two-pages: no such heading"
  echo 'as in `gst/gone.cpp`' >tree/$docs/guide/link.md
  expect_fault "$docs/guide/link.md: names \`gst/gone.cpp\`: no such file"
  rm tree/$docs/guide/link.md
  echo "/* see $docs/gone.md */" >tree/gst/there.cpp
  expect_fault "gst/there.cpp: names $docs/gone.md: no such file"
}
