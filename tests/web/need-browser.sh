# SPDX-License-Identifier: LGPL-2.1-or-later
# Sourced by the tests in a browser: sets CHROMIUM, RANGECAST_SOURCE, RANGECAST_BUILD, and `work`, a folder of the build with
# modules of npm.
# Exit status 77 (skipped) where Chromium, or these and the network that they come from, are missing.
RANGECAST_SOURCE=${RANGECAST_SOURCE:-$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)}
RANGECAST_BUILD=${RANGECAST_BUILD:-$RANGECAST_SOURCE/build}
CHROMIUM=$(command -v chromium || command -v chromium-browser || true)
export RANGECAST_SOURCE RANGECAST_BUILD CHROMIUM
export GST_PLUGIN_PATH=$RANGECAST_BUILD/gst GST_GL_PLATFORM=egl GST_GL_WINDOW=egl-device
skip () { echo "skipped: $*"; exit 77; }

[ -n "$CHROMIUM" ] || skip "chromium is missing"
work=$RANGECAST_BUILD/web-test
mkdir -p "$work"
packages=(puppeteer-core three vite ws iwer aframe)
# aframe names three-bmfont-text by a git address.
for package in "${packages[@]}"; do
  [ -d "$work/node_modules/$package" ] && continue
  command -v npm >/dev/null || skip "npm is missing, which installs ${packages[*]}"
  (cd "$work" && echo '{"overrides": {"three-bmfont-text": "3.0.1"}}' >package.json && timeout 240 npm install --silent --no-audit --no-fund "${packages[@]}" >/dev/null 2>&1) ||
    skip "npm cannot install ${packages[*]}"
done
