/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "messages.hpp"

#include <rangecast/geometry/rig.hpp>

using rangecast::CalibrationCamera;
using rangecast::CalibrationResult;
using rangecast::CalibrationSession;

namespace {

void
post (GstElement *element, GstStructure *structure)
{
  gst_element_post_message (element, gst_message_new_element (GST_OBJECT (element), structure));
}

/* With the fields pad, view and role. */
GstStructure *
new_camera_structure (const char *name, const CalibrationCamera &camera)
{
  return gst_structure_new (name, "pad", G_TYPE_STRING, camera.name.c_str (), "view", G_TYPE_INT,
      camera.view_id, "role", G_TYPE_STRING,
      std::string (rangecast::role_name (camera.role)).c_str (), nullptr);
}

/* @param take  void (GValue *, const Item &): sets the value */
template <typename Item, typename Take>
void
set_array (GstStructure *structure, const char *field, const std::vector<Item> &items, GType type,
    Take take)
{
  GValue array = G_VALUE_INIT;
  gst_value_array_init (&array, guint (items.size ()));
  for (const Item &item : items) {
    GValue value = G_VALUE_INIT;
    take (g_value_init (&value, type), item);
    gst_value_array_append_and_take_value (&array, &value);
  }
  gst_structure_take_value (structure, field, &array);
}

void
set_strings (GstStructure *structure, const char *field, const std::vector<std::string> &texts)
{
  set_array (structure, field, texts, G_TYPE_STRING,
      [] (GValue *value, const std::string &text) { g_value_set_string (value, text.c_str ()); });
}

GstStructure *
camera_structure (const CalibrationSession &session, const rangecast::CameraReport &report)
{
  GstStructure *s = new_camera_structure ("camera", session.cameras ()[report.camera]);
  gst_structure_set (s, "frames", G_TYPE_UINT, guint (report.frames), "rms", G_TYPE_DOUBLE,
      report.rms_px, "alone-rms", G_TYPE_DOUBLE, report.alone_rms_px, nullptr);
  return s;
}

GstStructure *
pair_structure (const CalibrationSession &session, const rangecast::PairReport &pair)
{
  return gst_structure_new ("pair", "first", G_TYPE_STRING,
      session.cameras ()[pair.a].name.c_str (), "second", G_TYPE_STRING,
      session.cameras ()[pair.b].name.c_str (), "frames", G_TYPE_UINT, guint (pair.frames), "rms",
      G_TYPE_DOUBLE, pair.rms_px, "distance", G_TYPE_DOUBLE, pair.distance_m, "row-error",
      G_TYPE_DOUBLE, pair.row_error_px, nullptr);
}

} // namespace

void
post_board (GstElement *element, const CalibrationSession &session, int camera, guint64 frame,
    GstClockTime running_time)
{
  GstStructure *s = new_camera_structure ("rigcalibrate-board", session.cameras ()[camera]);
  const guint corners = guint (session.corners (camera).size ());
  gst_structure_set (s, "frame", G_TYPE_UINT64, frame, "running-time", G_TYPE_UINT64, running_time,
      "seen", G_TYPE_BOOLEAN, corners > 0, "corners", G_TYPE_UINT, corners, "verdict",
      G_TYPE_STRING, std::string (rangecast::verdict_name (session.verdict ())).c_str (), nullptr);
  post (element, s);
}

void
post_coverage (GstElement *element, const CalibrationSession &session)
{
  const std::vector<int> groups = session.groups ();
  for (std::size_t i = 0; i < session.cameras ().size (); i++) {
    const rangecast::CameraCoverage c = session.coverage (int (i));
    std::string cells;
    for (const bool seen : c.cells)
      cells += seen ? '1' : '0';
    GstStructure *s = new_camera_structure ("rigcalibrate-coverage", session.cameras ()[i]);
    gst_structure_set (s, "frames", G_TYPE_UINT, guint (c.frames), "total-frames", G_TYPE_UINT,
        guint (session.frames ()), "share", G_TYPE_DOUBLE, c.share (), "complete", G_TYPE_BOOLEAN,
        c.complete (), "group", G_TYPE_INT, groups[i], "cells", G_TYPE_STRING, cells.c_str (),
        nullptr);
    set_strings (s, "missing", c.missing ());
    post (element, s);
  }
}

void
post_result (GstElement *element, const CalibrationSession &session,
    const CalibrationResult &result, const char *location)
{
  GstStructure *s = gst_structure_new ("rigcalibrate-result", "rms", G_TYPE_DOUBLE, result.rms_px,
      "frames", G_TYPE_UINT, guint (result.frames), nullptr);
  if (location)
    gst_structure_set (s, "location", G_TYPE_STRING, location, nullptr);
  set_array (s, "cameras", result.cameras, GST_TYPE_STRUCTURE, [&] (GValue *to, const auto &one) {
    g_value_take_boxed (to, camera_structure (session, one));
  });
  set_array (s, "pairs", result.pairs, GST_TYPE_STRUCTURE, [&] (GValue *to, const auto &one) {
    g_value_take_boxed (to, pair_structure (session, one));
  });
  set_array (s, "dropped", result.dropped, GST_TYPE_STRUCTURE, [&] (GValue *to, const auto &one) {
    g_value_take_boxed (
        to, gst_structure_new ("dropped", "pad", G_TYPE_STRING,
                session.cameras ()[one.camera].name.c_str (), "frame", G_TYPE_UINT64,
                guint64 (one.frame), "rms", G_TYPE_DOUBLE, one.rms_px, nullptr));
  });
  set_strings (s, "warnings", result.warnings);
  const auto blob = rangecast::encode_rig (result.rig);
  GstBuffer *rig = gst_buffer_new_memdup (blob.data (), blob.size ());
  gst_structure_set (s, "rig", GST_TYPE_BUFFER, rig, nullptr);
  gst_buffer_unref (rig);
  post (element, s);
}
