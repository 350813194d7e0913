/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <concepts>
#include <functional>
#include <initializer_list>
#include <string>
#include <type_traits>
#include <vector>

/* Properties of elements as tables of rows. A row names a member of the element's settings struct:
 * the member's type determines the GParamSpec, and its value in a default-constructed struct is the
 * default value. elementproperties.hpp installs a table together with `stats`. */

inline constexpr auto kReadWrite = GParamFlags (G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS);
/** A change takes effect in the states NULL and READY. */
inline constexpr auto kMutableReady = GParamFlags (kReadWrite | GST_PARAM_MUTABLE_READY);
/** A change takes effect in all states. */
inline constexpr auto kMutablePlaying = GParamFlags (kReadWrite | GST_PARAM_MUTABLE_PLAYING);
/** The same, and the element calls gst_object_sync_values() for each buffer. */
inline constexpr auto kControllable = GParamFlags (kMutablePlaying | GST_PARAM_CONTROLLABLE);
inline constexpr auto kReadOnly = GParamFlags (G_PARAM_READABLE | G_PARAM_STATIC_STRINGS);

/** A property that is stored in a member of `Settings`, or by functions of the element. */
template <typename Settings> struct PropertyRow {
  GParamSpec *spec; ///< floating until it is installed
  void (*set) (Settings &, const GValue *);
  void (*get) (const Settings &, GValue *);
};

namespace properties {

/* Follows a path of pointers to members. */
template <auto... kPath, typename Settings>
decltype (auto)
member (Settings &settings)
{
  if constexpr (sizeof...(kPath) == 0)
    return (settings);
  else
    return [&]<auto kFirst, auto... kRest> ()->decltype (auto)
    {
      return member<kRest...> (std::invoke (kFirst, settings));
    }
  .template operator()<kPath...> ();
}

template <typename T>
T
read (const GValue *value)
{
  if constexpr (std::same_as<T, bool>)
    return g_value_get_boolean (value) != FALSE;
  else if constexpr (std::same_as<T, double>)
    return g_value_get_double (value);
  else if constexpr (std::same_as<T, std::string>) {
    const gchar *text = g_value_get_string (value);
    return text ? text : "";
  } else { /* whole numbers, enumerations and flags */
    GValue number = G_VALUE_INIT;
    g_value_transform (value, g_value_init (&number, G_TYPE_INT64));
    return static_cast<T> (g_value_get_int64 (&number));
  }
}

template <typename T>
void
write (const T &member, GValue *value)
{
  if constexpr (std::same_as<T, bool>)
    g_value_set_boolean (value, member);
  else if constexpr (std::same_as<T, double>)
    g_value_set_double (value, member);
  else if constexpr (std::same_as<T, std::string>)
    g_value_set_string (value, member.empty () ? nullptr : member.c_str ());
  else {
    GValue number = G_VALUE_INIT;
    g_value_set_int64 (g_value_init (&number, G_TYPE_INT64), static_cast<gint64> (member));
    g_value_transform (&number, value);
  }
}

template <typename Settings, auto... kPath>
PropertyRow<Settings>
row (GParamSpec *spec)
{
  using Member = std::remove_cvref_t<decltype (member<kPath...> (std::declval<Settings &> ()))>;
  return {spec,
      [] (Settings &settings, const GValue *value) {
        member<kPath...> (settings) = read<Member> (value);
      },
      [] (const Settings &settings, GValue *value) {
        write<Member> (member<kPath...> (settings), value);
      }};
}

template <typename T>
GParamSpec *
number_spec (const char *name, const char *nick, const char *blurb, T minimum, T maximum,
    T default_value, GParamFlags flags)
{
  if constexpr (std::same_as<T, double>)
    return g_param_spec_double (name, nick, blurb, minimum, maximum, default_value, flags);
  else if constexpr (std::same_as<T, gint>)
    return g_param_spec_int (name, nick, blurb, minimum, maximum, default_value, flags);
  else if constexpr (std::same_as<T, guint>)
    return g_param_spec_uint (name, nick, blurb, minimum, maximum, default_value, flags);
  else if constexpr (std::signed_integral<T>)
    return g_param_spec_int64 (name, nick, blurb, minimum, maximum, default_value, flags);
  else
    return g_param_spec_uint64 (name, nick, blurb, minimum, maximum, default_value, flags);
}

} // namespace properties

/** The properties of an element's settings. Created in class_init and never freed, like the class.
 */
template <typename Settings> class PropertyTable {
public:
  using Row = PropertyRow<Settings>;

  PropertyTable (std::initializer_list<Row> rows) : rows_ (rows) {}

  /** A number (gint, guint, gint64, guint64 or double).
   *  @tparam kPath  path from Settings to the member: pointers to members, or functions that return
   *  a reference */
  template <auto... kPath, typename Minimum, typename Maximum>
  static Row number (const char *name, const char *nick, const char *blurb, Minimum minimum,
      Maximum maximum, GParamFlags flags)
  {
    const Settings defaults{};
    const auto default_value = properties::member<kPath...> (defaults);
    using T = std::remove_cv_t<decltype (default_value)>;
    return properties::row<Settings, kPath...> (properties::number_spec<T> (
        name, nick, blurb, T (minimum), T (maximum), default_value, flags));
  }

  /** A bool. */
  template <auto... kPath>
  static Row boolean (const char *name, const char *nick, const char *blurb, GParamFlags flags)
  {
    const Settings defaults{};
    return properties::row<Settings, kPath...> (
        g_param_spec_boolean (name, nick, blurb, properties::member<kPath...> (defaults), flags));
  }

  /** A std::string; an empty one reads as null. */
  template <auto... kPath>
  static Row text (const char *name, const char *nick, const char *blurb, GParamFlags flags)
  {
    const Settings defaults{};
    const std::string &default_value = properties::member<kPath...> (defaults);
    return properties::row<Settings, kPath...> (g_param_spec_string (
        name, nick, blurb, default_value.empty () ? nullptr : default_value.c_str (), flags));
  }

  /** An enumeration. @param type_name  GType to register with `values`, which GLib keeps; gets
   *  marked as plugin API, so that documentation tools find it */
  template <auto... kPath>
  static Row enumeration (const char *name, const char *nick, const char *blurb,
      const char *type_name, const GEnumValue *values, GParamFlags flags)
  {
    const Settings defaults{};
    const GType type = g_enum_register_static (type_name, values);
    gst_type_mark_as_plugin_api (type, GstPluginAPIFlags (0));
    return properties::row<Settings, kPath...> (g_param_spec_enum (
        name, nick, blurb, type, int (properties::member<kPath...> (defaults)), flags));
  }

  /** The same for a set of flags. */
  template <auto... kPath>
  static Row flags (const char *name, const char *nick, const char *blurb, const char *type_name,
      const GFlagsValue *values, GParamFlags flags)
  {
    const Settings defaults{};
    const GType type = g_flags_register_static (type_name, values);
    gst_type_mark_as_plugin_api (type, GstPluginAPIFlags (0));
    return properties::row<Settings, kPath...> (g_param_spec_flags (
        name, nick, blurb, type, properties::member<kPath...> (defaults), flags));
  }

  /** Installs the rows with the ids `first_id` and following. @return the next free id */
  guint install (GObjectClass *object_class, guint first_id)
  {
    first_id_ = first_id;
    for (const Row &row : rows_)
      g_object_class_install_property (object_class, first_id++, row.spec);
    return first_id;
  }

  /** @return false if the table has no property with that id */
  bool set (Settings &settings, guint id, const GValue *value) const
  {
    const Row *row = find (id);
    if (row)
      row->set (settings, value);
    return row != nullptr;
  }
  bool get (const Settings &settings, guint id, GValue *value) const
  {
    const Row *row = find (id);
    if (row)
      row->get (settings, value);
    return row != nullptr;
  }

  /** Calls g_object_notify_by_pspec() for each property whose value differs. Call without locks
   *  held. */
  void notify_changes (GObject *object, const Settings &before, const Settings &after) const
  {
    for (const Row &row : rows_) {
      GValue values[2] = {G_VALUE_INIT, G_VALUE_INIT};
      g_value_init (&values[0], row.spec->value_type);
      g_value_init (&values[1], row.spec->value_type);
      row.get (before, &values[0]);
      row.get (after, &values[1]);
      if (g_param_values_cmp (row.spec, &values[0], &values[1]) != 0)
        g_object_notify_by_pspec (object, row.spec);
      g_value_unset (&values[0]);
      g_value_unset (&values[1]);
    }
  }

private:
  const Row *find (guint id) const
  {
    return id >= first_id_ && id - first_id_ < rows_.size () ? &rows_[id - first_id_] : nullptr;
  }

  std::vector<Row> rows_;
  guint first_id_ = 1;
};

/** Installs the read-only property `stats`, a GstStructure. @param blurb  names its fields */
inline void
install_stats (GObjectClass *object_class, guint id, const char *blurb, const char *name = "stats")
{
  g_object_class_install_property (object_class, id,
      g_param_spec_boxed (name, "Statistics", blurb, GST_TYPE_STRUCTURE, kReadOnly));
}
