/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

/** Writes the graph of a message's pipeline to GST_DEBUG_DUMP_DOT_DIR, as gst-launch-1.0 does, when
 *  the pipeline plays and when one of its elements fails: TIME-PROGRAM.PLAYING.dot,
 *  TIME-PROGRAM.ERROR.dot. Any thread. */
inline void
dump_graph (GstMessage *message, const char *program)
{
  GstState state = GST_STATE_NULL;
  const bool failed = GST_MESSAGE_TYPE (message) == GST_MESSAGE_ERROR;
  if (GST_MESSAGE_TYPE (message) == GST_MESSAGE_STATE_CHANGED && GST_IS_PIPELINE (message->src))
    gst_message_parse_state_changed (message, nullptr, &state, nullptr);
  if (!message->src || (!failed && state != GST_STATE_PLAYING))
    return;
  auto top = GST_OBJECT (gst_object_ref (message->src));
  while (GstObject *parent = gst_object_get_parent (top)) {
    gst_object_unref (top);
    top = parent;
  }
  gchar *name = g_strconcat (program, failed ? ".ERROR" : ".PLAYING", nullptr);
  if (GST_IS_BIN (top))
    GST_DEBUG_BIN_TO_DOT_FILE_WITH_TS (GST_BIN (top), GST_DEBUG_GRAPH_SHOW_ALL, name);
  g_free (name);
  gst_object_unref (top);
}
