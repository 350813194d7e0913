/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "common/properties.hpp"
#include "common/statsreporter.hpp"

#include <mutex>
#include <type_traits>

/* set_property, get_property and the installation of properties for elements that have the usual
 * three kinds: settings in a table, `stats` and `stats-interval`. */

/** Declares the type of an element, and its struct, whose state is in `priv`. */
#define DECLARE_ELEMENT(Name, name, MODULE, Parent)                                                \
  G_DECLARE_FINAL_TYPE (Name, name, GST, MODULE, Parent)                                           \
  struct _##Name {                                                                                 \
    Parent parent;                                                                                 \
    struct Name##Private *priv;                                                                    \
  };

/** finalize() of an element whose `priv` was made by new and is all that it owns. */
template <typename Element>
void
delete_private (GObject *object)
{
  delete reinterpret_cast<Element *> (object)->priv;
  G_OBJECT_CLASS (g_type_class_peek_parent (G_OBJECT_GET_CLASS (object)))->finalize (object);
}

/** Adds the templates of the pads "sink" and "src". */
inline void
add_always_pads (GstElementClass *element_class, const char *sink_caps, const char *src_caps)
{
  GstStaticPadTemplate templates[] = {
      GST_STATIC_PAD_TEMPLATE ("sink", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS (sink_caps)),
      GST_STATIC_PAD_TEMPLATE ("src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS (src_caps))};
  for (GstStaticPadTemplate &one : templates)
    gst_element_class_add_static_pad_template (element_class, &one);
}

/** A copy of an element's settings. Any thread, without the lock held. */
template <typename Private>
auto
settings_of (Private *priv)
{
  std::lock_guard guard (priv->lock);
  return priv->settings;
}

namespace properties {

enum : guint { kStatsId = 1, kStatsIntervalId, kFirstSettingId };

template <typename Element, auto kTable>
void
set_property (GObject *object, guint id, const GValue *value, GParamSpec *pspec)
{
  auto priv = reinterpret_cast<Element *> (object)->priv;
  if constexpr (requires { priv->reporter.interval (); })
    if (id == kStatsIntervalId)
      return priv->reporter.set_interval (g_value_get_uint (value));
  if constexpr (!std::is_null_pointer_v<decltype (kTable)>) {
    std::lock_guard guard (priv->lock);
    if (kTable ().set (priv->settings, id, value))
      return;
  }
  G_OBJECT_WARN_INVALID_PROPERTY_ID (object, id, pspec);
}

template <typename Element, auto kTable, auto kMakeStats>
void
get_property (GObject *object, guint id, GValue *value, GParamSpec *pspec)
{
  auto priv = reinterpret_cast<Element *> (object)->priv;
  if constexpr (requires { priv->reporter.interval (); })
    if (id == kStatsIntervalId)
      return g_value_set_uint (value, priv->reporter.interval ());
  std::lock_guard guard (priv->lock);
  if constexpr (!std::is_null_pointer_v<decltype (kMakeStats)>)
    if (id == kStatsId)
      return g_value_take_boxed (value, kMakeStats (priv));
  if constexpr (!std::is_null_pointer_v<decltype (kTable)>)
    if (kTable ().get (priv->settings, id, value))
      return;
  G_OBJECT_WARN_INVALID_PROPERTY_ID (object, id, pspec);
}

} // namespace properties

/** Sets set_property and get_property of an element's class and installs its properties; for
 *  class_init. `Element` has a pointer `priv` to a struct with
 *  - `std::mutex lock`, which guards `settings` and what `kMakeStats` reads,
 *  - `settings`, if there is a table,
 *  - optionally `StatsReporter reporter`: then there is a property `stats-interval`.
 *  @tparam kTable      function that returns the PropertyTable of `settings` by reference; nullptr:
 *  there are no settings
 *  @tparam kMakeStats  function that returns the value of `stats` (transfer full) from `priv`;
 *  called with `lock` held; nullptr: no property `stats`
 *  @param stats_blurb  names the fields of `stats`
 *  @param stats_name   another name, where the base class has a property `stats` */
template <typename Element, auto kTable, auto kMakeStats = nullptr>
void
install_properties (
    GObjectClass *klass, const char *stats_blurb = nullptr, const char *stats_name = "stats")
{
  klass->set_property = properties::set_property<Element, kTable>;
  klass->get_property = properties::get_property<Element, kTable, kMakeStats>;
  if constexpr (!std::is_null_pointer_v<decltype (kMakeStats)>)
    install_stats (klass, properties::kStatsId, stats_blurb, stats_name);
  if constexpr (requires (Element * element) { element->priv->reporter.interval (); })
    StatsReporter::install (klass, properties::kStatsIntervalId);
  if constexpr (!std::is_null_pointer_v<decltype (kTable)>)
    kTable ().install (klass, properties::kFirstSettingId);
}

/** The same for a pad's class. `Pad` has `settings`, which the pad's object lock guards and which
 * zero bytes make valid. */
template <typename Pad, auto kTable>
void
install_pad_properties (GObjectClass *klass)
{
  klass->set_property = [] (GObject *pad, guint id, const GValue *value, GParamSpec *) {
    GST_OBJECT_LOCK (pad);
    kTable ().set (reinterpret_cast<Pad *> (pad)->settings, id, value);
    GST_OBJECT_UNLOCK (pad);
  };
  klass->get_property = [] (GObject *pad, guint id, GValue *value, GParamSpec *) {
    GST_OBJECT_LOCK (pad);
    kTable ().get (reinterpret_cast<Pad *> (pad)->settings, id, value);
    GST_OBJECT_UNLOCK (pad);
  };
  kTable ().install (klass, 1);
}

/** GstChildProxy of an element whose children are its sink pads, so that launch strings can set
 * their properties: sink_1::view=0. For G_IMPLEMENT_INTERFACE, with announce_pads() in class_init.
 */
inline void
init_pad_proxy (gpointer iface, gpointer)
{
  auto proxy = static_cast<GstChildProxyInterface *> (iface);
  proxy->get_child_by_index = [] (GstChildProxy *element, guint index) {
    GST_OBJECT_LOCK (element);
    gpointer pad = g_list_nth_data (GST_ELEMENT_CAST (element)->sinkpads, index);
    if (pad)
      gst_object_ref (pad);
    GST_OBJECT_UNLOCK (element);
    return static_cast<GObject *> (pad);
  };
  proxy->get_children_count = [] (GstChildProxy *element) {
    return guint (GST_ELEMENT_CAST (element)->numsinkpads);
  };
}

inline void
announce_pads (GstElementClass *klass)
{
  klass->pad_added = [] (GstElement *element, GstPad *pad) {
    gst_child_proxy_child_added (GST_CHILD_PROXY (element), G_OBJECT (pad), GST_PAD_NAME (pad));
  };
  klass->pad_removed = [] (GstElement *element, GstPad *pad) {
    gst_child_proxy_child_removed (GST_CHILD_PROXY (element), G_OBJECT (pad), GST_PAD_NAME (pad));
  };
}
