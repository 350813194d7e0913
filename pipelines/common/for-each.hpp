/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

/** Calls a function for each of some elements, for all again when their bin has changed meanwhile.
 *  @param elements  transfer full */
template <typename Function>
void
for_each (GstIterator *elements, Function function)
{
  const auto call = [] (const GValue *element, gpointer data) {
    (*static_cast<Function *> (data)) (GST_ELEMENT (g_value_get_object (element)));
  };
  while (gst_iterator_foreach (elements, call, &function) == GST_ITERATOR_RESYNC)
    gst_iterator_resync (elements);
  gst_iterator_free (elements);
}
