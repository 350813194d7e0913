/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "downstream.hpp"

#include <algorithm>
#include <gstrange/gstrangecaps.h>
#include <vector>

namespace {

constexpr int kMaxHops = 64;
constexpr std::size_t kMaxTypes = 3; /* in a sentence */

using Types = std::vector<std::string>;

Types
media_types (const GstCaps *caps)
{
  Types types;
  for (guint i = 0; i < gst_caps_get_size (caps); i++)
    if (const char *type = gst_structure_get_name (gst_caps_get_structure (caps, i));
        std::ranges::find (types, type) == types.end ())
      types.emplace_back (type);
  return types;
}

bool
shares_type (const Types &types, const GstCaps *caps)
{
  const auto is_taken = [taken = media_types (caps)] (const std::string &type) {
    return std::ranges::find (taken, type) != taken.end ();
  };
  return gst_caps_is_any (caps) || std::ranges::any_of (types, is_taken);
}

std::string
join (const Types &types)
{
  std::string text;
  for (std::size_t i = 0; i < std::min (types.size (), kMaxTypes); i++)
    text += (i > 0 ? ", " : "") + types[i];
  return types.size () > kMaxTypes ? text + " ..." : text;
}

const char *
how_to_draw (const std::string &made, const Types &taken)
{
  if (std::ranges::find (taken, "video/x-raw") == taken.end ())
    return "";
  return made == GST_RANGE_MEDIA_TYPE            ? "; striprender draws it"
         : made == GST_NEIGHBOUR_CODE_MEDIA_TYPE ? "; neighbourcodedec ! striprender draw it"
                                                 : "";
}

std::string
name_of_parent (GstPad *pad)
{
  GstObject *parent = gst_pad_get_parent (pad);
  const std::string name = parent ? GST_OBJECT_NAME (parent) : GST_OBJECT_NAME (pad);
  gst_clear_object (&parent);
  return name;
}

/* @return transfer full; nullptr if the pad's element does not have just one source pad */
GstPad *
next_source_pad (GstPad *sink)
{
  GstElement *element = gst_pad_get_parent_element (sink);
  if (!element)
    return nullptr;
  GST_OBJECT_LOCK (element);
  auto next = element->numsrcpads == 1
                  ? static_cast<GstPad *> (gst_object_ref (element->srcpads->data))
                  : nullptr;
  GST_OBJECT_UNLOCK (element);
  gst_object_unref (element);
  return next;
}

/* Follows the links as long as elements could pass the media types on. */
class Walk {
public:
  explicit Walk (GstPad *src) : pad_ (static_cast<GstPad *> (gst_object_ref (src))) { make (src); }
  ~Walk () { gst_clear_object (&pad_); }
  Walk (const Walk &) = delete;
  Walk &operator= (const Walk &) = delete;

  /* @return false at the end; `text` then says why, if media types differ there */
  bool step (std::string &text)
  {
    GstPad *peer = GST_PAD_IS_FLUSHING (pad_) ? nullptr : gst_pad_get_peer (pad_);
    if (!peer)
      return false;
    GstPad *next = nullptr;
    if (GST_IS_PROXY_PAD (peer) && !GST_IS_GHOST_PAD (peer)) /* out of a bin */
      next = GST_PAD (gst_pad_get_parent (peer));
    else
      next = pass (peer, text);
    gst_object_unref (peer);
    gst_object_unref (pad_);
    pad_ = next;
    return pad_ != nullptr;
  }

private:
  /* Elements such as queue make what they get. */
  void make (GstPad *src)
  {
    GstCaps *caps = gst_pad_get_pad_template_caps (src);
    if (!gst_caps_is_any (caps)) {
      maker_ = name_of_parent (src);
      made_ = media_types (caps);
    }
    gst_caps_unref (caps);
  }

  void explain (GstPad *sink, const GstCaps *taken, std::string &text) const
  {
    if (made_.empty () || gst_caps_is_empty (taken))
      return;
    const Types types = media_types (taken);
    text = maker_ + " makes " + join (made_) + ", and " + name_of_parent (sink) + " takes " +
           join (types) + how_to_draw (made_.front (), types);
  }

  /* @return transfer full: where to look next for what takes none of the types */
  GstPad *pass (GstPad *sink, std::string &text)
  {
    GstCaps *possible = gst_pad_get_pad_template_caps (sink),
            *taken = gst_pad_query_caps (sink, nullptr);
    GstPad *next = nullptr;
    if (!shares_type (made_, taken)) {
      if (!shares_type (made_, possible))
        explain (sink, possible, text);
      else if ((next = next_source_pad (sink)))
        make (next);
      else
        explain (sink, taken, text);
    }
    gst_caps_unref (possible);
    gst_caps_unref (taken);
    return next;
  }

  GstPad *pad_;
  std::string maker_;
  Types made_; /* media types */
};

} // namespace

std::string
explain_downstream (GstPad *src)
{
  std::string text;
  Walk walk (src);
  for (int i = 0; i < kMaxHops && walk.step (text); i++)
    ;
  return text;
}

bool
require_downstream (GstElement *element, GstPad *src)
{
  const std::string text = explain_downstream (src);
  if (!text.empty ())
    GST_ELEMENT_ERROR (element, CORE, NEGOTIATION, ("%s", text.c_str ()), (nullptr));
  return text.empty ();
}

gboolean
negotiate_downstream (GstAggregator *aggregator)
{
  auto klass = static_cast<GstAggregatorClass *> (g_type_class_peek (GST_TYPE_AGGREGATOR));
  return require_downstream (GST_ELEMENT (aggregator), GST_AGGREGATOR_SRC_PAD (aggregator)) &&
         klass->negotiate (aggregator);
}
