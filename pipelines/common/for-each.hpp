/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

/** Calls a function for each of some elements, for all again when their bin has changed meanwhile.
 *  @param elements  transfer full */
inline void
for_each (GstIterator *elements, void (*function) (GstElement *))
{
  const auto call = [] (const GValue *element, gpointer called) {
    reinterpret_cast<void (*) (GstElement *)> (called) (GST_ELEMENT (g_value_get_object (element)));
  };
  while (gst_iterator_foreach (elements, call, reinterpret_cast<gpointer> (function)) ==
         GST_ITERATOR_RESYNC)
    gst_iterator_resync (elements);
  gst_iterator_free (elements);
}
