/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* A stereodepth in harnesses, and a rig file for it. */
#pragma once

#include "../rangecast-check.hpp"

#include <glib/gstdio.h>
#include <gst/video/video.h>

#include <rangecast/rigfile/rig_file.hpp>
#include <vector>

namespace rangecast::testing {

inline constexpr GstClockTime kFrame = GST_SECOND / 25;
inline constexpr const char *kSmall = "video/x-raw,format=RGBx,width=160,height=120,framerate=25/1";
inline constexpr const char *kProperties = "focal-length=160 baseline=0.1 near=0.3 far=1.5";

struct Stereo {
  GstHarness *left, *right;
  GstBus *bus = gst_bus_new ();

  explicit Stereo (const std::string &properties = kProperties,
      const char *left_caps = "video/x-raw,format=RGBx,width=160,height=120,framerate=25/1",
      const char *right_caps = "video/x-raw,format=RGBx,width=160,height=120,framerate=25/1")
  {
    GstElement *element = gst_parse_launch (("stereodepth " + properties).c_str (), nullptr);
    gst_element_set_bus (element, bus);
    left = gst_harness_new_with_element (element, "left", "src");
    right = gst_harness_new_with_element (element, "right", nullptr);
    gst_harness_set_live (left, FALSE);
    gst_harness_set_live (right, FALSE);
    gst_object_unref (element);
    gst_harness_set_src_caps_str (left, left_caps);
    gst_harness_set_src_caps_str (right, right_caps);
  }
  ~Stereo ()
  {
    gst_element_set_bus (left->element, nullptr);
    gst_object_unref (bus);
    gst_harness_teardown (right);
    gst_harness_teardown (left);
  }
  /* Random dots; the right picture sees them 20 pixels further left: 0.8 m away. */
  static GstBuffer *dots (bool is_right, GstClockTime pts)
  {
    GRand *random = g_rand_new_with_seed (5);
    std::vector<guint8> pixels (160 * 120 * 4);
    for (int y = 0; y < 120; y++) {
      guint8 row[180];
      for (guint8 &c : row)
        c = guint8 (g_rand_int (random));
      for (int x = 0; x < 160; x++)
        for (int c = 0; c < 4; c++)
          pixels[4 * (160 * y + x) + c] = row[x + (is_right ? 20 : 0)];
    }
    g_rand_free (random);
    GstBuffer *buffer = gst_buffer_new_memdup (pixels.data (), pixels.size ());
    GST_BUFFER_PTS (buffer) = pts;
    return buffer;
  }
  void push (GstHarness *h, GstClockTime pts) { gst_harness_push (h, dots (h == right, pts)); }
  guint64 stat (const char *field)
  {
    GstStructure *stats;
    guint64 value = G_MAXUINT64;
    g_object_get (left->element, "stats", &stats, nullptr);
    gst_structure_get_uint64 (stats, field, &value);
    gst_structure_free (stats);
    return value;
  }
};

/* A rig file of the ring's first view with cameras beside and above it, 320x240. */
struct RigFile {
  gchar *path;

  explicit RigFile (bool with_third = true)
      : path (g_strdup_printf (
            "%s/stereodepth-%d-%d.yaml", g_get_tmp_dir (), int (getpid ()), g_random_int ()))
  {
    Rig rig = ring_rig (1);
    View &view = rig.views[0];
    view.right = PartnerCamera{view.intrinsics, {}, {kIdentity3, {-0.1, 0, 0}}};
    if (with_third)
      view.third = PartnerCamera{view.intrinsics, {}, {kIdentity3, {0, 0.1, 0}}};
    fail_unless_ok (save_rig (path, rig));
  }
  ~RigFile ()
  {
    g_unlink (path);
    g_free (path);
  }
  std::string property () const { return std::string ("rig=") + path; }
};

} // namespace rangecast::testing
