/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <cstddef>

/* Properties that are plain numbers of a struct of settings, as tables. */

template <typename Settings, typename T> struct NumberRow {
  const char *name, *nick, *blurb;
  T minimum, maximum, fallback;
  T &(*field) (Settings &);
};

/* The row of a property in a table whose first row is number `first`, or null if it is not there.
 */
template <typename Row, std::size_t N>
const Row *
find_row (const Row (&rows)[N], guint id, guint first)
{
  return id >= first && id < first + N ? &rows[id - first] : nullptr;
}

template <typename Settings, std::size_t N>
void
install_rows (GObjectClass *object_class, const NumberRow<Settings, double> (&rows)[N], guint first,
    GParamFlags flags)
{
  for (const auto &row : rows)
    g_object_class_install_property (object_class, first++,
        g_param_spec_double (
            row.name, row.nick, row.blurb, row.minimum, row.maximum, row.fallback, flags));
}

template <typename Settings, std::size_t N>
void
install_rows (GObjectClass *object_class, const NumberRow<Settings, int> (&rows)[N], guint first,
    GParamFlags flags)
{
  for (const auto &row : rows)
    g_object_class_install_property (object_class, first++,
        g_param_spec_int (
            row.name, row.nick, row.blurb, row.minimum, row.maximum, row.fallback, flags));
}
