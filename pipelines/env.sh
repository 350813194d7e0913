# SPDX-License-Identifier: LGPL-2.1-or-later
# Source it, in any POSIX shell: makes the elements, programs and libraries of the build tree known to GStreamer, Python and
# pkg-config (installed ones are found without it). Reports a missing or incomplete build. Shells other than Bash and zsh do not tell where it lies: source it in the top folder of the tree there.

rangecast_top=${BASH_SOURCE:-$0}
rangecast_top=$(cd "$(dirname "$rangecast_top")/.." && pwd)
[ -f "$rangecast_top/pipelines/env.sh" ] || rangecast_top=$PWD

if [ -d "$rangecast_top/build/gst" ]; then
  export GST_PLUGIN_PATH="$rangecast_top/build/gst${GST_PLUGIN_PATH:+:$GST_PLUGIN_PATH}"
  export GST_REGISTRY="${GST_REGISTRY:-$rangecast_top/build/registry.bin}"
  export PATH="$rangecast_top/build/pipelines:$rangecast_top/build/tests/simulators:$PATH"
  export LD_LIBRARY_PATH="$rangecast_top/build/lib/gstrange:$rangecast_top/build/lib/capi${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}"
  export GI_TYPELIB_PATH="$rangecast_top/build/lib/gstrange${GI_TYPELIB_PATH:+:$GI_TYPELIB_PATH}"
  export PYTHONPATH="$rangecast_top/lib/gstrange/python${PYTHONPATH:+:$PYTHONPATH}"
  export PKG_CONFIG_PATH="$rangecast_top/build/meson-uninstalled${PKG_CONFIG_PATH:+:$PKG_CONFIG_PATH}"
  (cd "$rangecast_top/build" && ls gst/align/lib*.so gst/codec/lib*.so gst/convert/lib*.so gst/depth/lib*.so gst/mux/lib*.so \
    gst/render/lib*.so gst/rtp/lib*.so gst/testsrc/lib*.so pipelines/rangecast pipelines/rangecast-run) >/dev/null 2>&1 ||
    echo "env.sh: $rangecast_top/build is incomplete: run $rangecast_top/setup.sh" >&2 # as setup.sh --demo builds it
elif ! gst-inspect-1.0 --exists --atleast-version=0.0.0 neighbourcodeenc 2>/dev/null; then # it asks for 1.0 otherwise
  echo "env.sh: gst-rangecast is neither built nor installed: run $rangecast_top/setup.sh" >&2
fi
unset rangecast_top
