/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Prints pads, properties, values of enumerations and signals of an element as Markdown tables,
 * for docs/elements/update.py. Only what the element itself declares is listed, not what its base
 * classes do. usage: element-tables [ELEMENT]; without ELEMENT it prints the names of all elements
 * of this project. */

#include <gst/gst.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

namespace {

std::string
replace_all (std::string text, const std::string &from, const std::string &to)
{
  for (std::size_t at = 0; (at = text.find (from, at)) != std::string::npos; at += to.size ())
    text.replace (at, from.size (), to);
  return text;
}

/* Text for a cell of a table. */
std::string
cell (const char *text)
{
  auto escaped = replace_all (text ? text : "", "|", "\\|");
  return replace_all (replace_all (escaped, "<", "&lt;"), ">", "&gt;");
}

std::string
take (gchar *text)
{
  std::string copy = text ? text : "";
  g_free (text);
  return copy;
}

/* A value as in launch strings, without types. */
std::string
value_text (const GValue *value)
{
  std::string text = take (gst_value_serialize (value));
  for (const char *type : {"\"", "(string)", "(int)", "(double)", "(fraction)"})
    text = replace_all (text, type, "");
  for (const auto &[from, to] : {std::pair ("[ ", "["), {" ]", "]"}, {"< ", "<"}, {" >", ">"}})
    text = replace_all (text, from, to);
  return text;
}

/* ---- pads ---- */

bool
is_full_range (const GValue *value)
{
  if (GST_VALUE_HOLDS_INT_RANGE (value)) /* 16384 is the widest view */
    return gst_value_get_int_range_min (value) <= 1 && gst_value_get_int_range_max (value) >= 16384;
  if (GST_VALUE_HOLDS_FRACTION_RANGE (value)) {
    const GValue *max = gst_value_get_fraction_range_max (value);
    return gst_value_get_fraction_numerator (max) == G_MAXINT;
  }
  return false;
}

struct FieldText {
  std::string text;
};

gboolean
append_field (GQuark id, const GValue *value, gpointer data)
{
  auto &out = static_cast<FieldText *> (data)->text;
  const std::string name = g_quark_to_string (id);
  if (is_full_range (value))
    return TRUE;
  if (name == "format" && GST_VALUE_HOLDS_LIST (value) && gst_value_list_get_size (value) > 12)
    return TRUE;
  out += ", " + name + "=" + value_text (value);
  return TRUE;
}

std::string
caps_text (GstCaps *caps)
{
  if (gst_caps_is_any (caps))
    return "any";
  std::vector<std::string> structures;
  for (guint i = 0; i < gst_caps_get_size (caps); i++) {
    GstStructure *structure = gst_caps_get_structure (caps, i);
    FieldText fields;
    gst_structure_foreach (structure, append_field, &fields);
    GstCapsFeatures *features = gst_caps_get_features (caps, i);
    std::string name = gst_structure_get_name (structure);
    if (features && !gst_caps_features_is_equal (features, GST_CAPS_FEATURES_MEMORY_SYSTEM_MEMORY))
      name += "(" + take (gst_caps_features_to_string (features)) + ")";
    structures.push_back ("`" + name + fields.text + "`");
  }
  std::string text;
  for (const auto &structure : structures)
    if (text.find (structure) == std::string::npos)
      text += (text.empty () ? "" : "<br>") + structure;
  return replace_all (text, "|", "\\|");
}

void
print_pads (GstElementClass *klass)
{
  GList *templates = g_list_copy (gst_element_class_get_pad_template_list (klass));
  templates = g_list_sort (templates, [] (gconstpointer a, gconstpointer b) -> gint {
    const auto one = GST_PAD_TEMPLATE (a), other = GST_PAD_TEMPLATE (b);
    if (GST_PAD_TEMPLATE_DIRECTION (one) != GST_PAD_TEMPLATE_DIRECTION (other))
      return GST_PAD_TEMPLATE_DIRECTION (one) == GST_PAD_SINK ? -1 : 1;
    return g_strcmp0 (GST_PAD_TEMPLATE_NAME_TEMPLATE (one), GST_PAD_TEMPLATE_NAME_TEMPLATE (other));
  });
  if (templates)
    std::printf ("| pad | direction, presence | caps |\n|---|---|---|\n");
  for (GList *item = templates; item; item = item->next) {
    auto pad = GST_PAD_TEMPLATE (item->data);
    static const char *const kPresences[] = {"always", "sometimes", "request"};
    std::printf ("| `%s` | %s, %s | %s |\n", GST_PAD_TEMPLATE_NAME_TEMPLATE (pad),
        GST_PAD_TEMPLATE_DIRECTION (pad) == GST_PAD_SINK ? "sink" : "source",
        kPresences[GST_PAD_TEMPLATE_PRESENCE (pad)],
        caps_text (GST_PAD_TEMPLATE_CAPS (pad)).c_str ());
  }
  g_list_free (templates);
}

/* ---- properties ---- */

std::string
number (gint64 value)
{
  switch (value) {
    case G_MAXINT:
      return "G_MAXINT";
    case G_MININT:
      return "G_MININT";
    case G_MAXUINT:
      return "G_MAXUINT";
    case G_MAXINT64:
      return "G_MAXINT64";
    default:
      return std::to_string (value);
  }
}

std::string
number (guint64 value)
{
  if (value == G_MAXUINT64)
    return "G_MAXUINT64";
  return value > G_MAXINT64 ? std::to_string (value) : number (gint64 (value));
}

std::string
number (double value)
{
  if (value == G_MAXDOUBLE || value == -G_MAXDOUBLE)
    return value > 0 ? "G_MAXDOUBLE" : "-G_MAXDOUBLE";
  return take (g_strdup_printf ("%.10g", value));
}

template <typename T>
std::string
range (const char *type, T minimum, T maximum)
{
  return std::string (type) + ", " + number (minimum) + " to " + number (maximum);
}

/* Type and range of a property. */
std::string
type_text (GParamSpec *spec)
{
  if (auto s = G_IS_PARAM_SPEC_INT (spec) ? G_PARAM_SPEC_INT (spec) : nullptr)
    return range ("int", gint64 (s->minimum), gint64 (s->maximum));
  if (auto s = G_IS_PARAM_SPEC_UINT (spec) ? G_PARAM_SPEC_UINT (spec) : nullptr)
    return range ("uint", guint64 (s->minimum), guint64 (s->maximum));
  if (auto s = G_IS_PARAM_SPEC_INT64 (spec) ? G_PARAM_SPEC_INT64 (spec) : nullptr)
    return range ("int64", s->minimum, s->maximum);
  if (auto s = G_IS_PARAM_SPEC_UINT64 (spec) ? G_PARAM_SPEC_UINT64 (spec) : nullptr)
    return range ("uint64", s->minimum, s->maximum);
  if (auto s = G_IS_PARAM_SPEC_DOUBLE (spec) ? G_PARAM_SPEC_DOUBLE (spec) : nullptr)
    return range ("double", s->minimum, s->maximum);
  if (GST_IS_PARAM_SPEC_FRACTION (spec)) {
    auto s = GST_PARAM_SPEC_FRACTION (spec);
    return "fraction, " + number (gint64 (s->min_num)) + "/" + number (gint64 (s->min_den)) +
           " to " + number (gint64 (s->max_num)) + "/" + number (gint64 (s->max_den));
  }
  if (GST_IS_PARAM_SPEC_ARRAY_LIST (spec))
    return "GstValueArray";
  if (G_IS_PARAM_SPEC_STRING (spec))
    return "string";
  if (G_IS_PARAM_SPEC_BOOLEAN (spec))
    return "boolean";
  if (G_IS_PARAM_SPEC_ENUM (spec))
    return "enum";
  if (G_IS_PARAM_SPEC_FLAGS (spec))
    return "flags";
  return g_type_name (spec->value_type);
}

std::string
flags_text (GFlagsClass *klass, guint value)
{
  std::string text;
  for (guint i = 0; i < klass->n_values; i++)
    if (const auto &flag = klass->values[i];
        value ? flag.value && (value & flag.value) == flag.value : flag.value == 0)
      text += (text.empty () ? "" : "+") + std::string (flag.value_nick);
  return text;
}

/* The value that a new object has. */
std::string
default_text (GObject *object, GParamSpec *spec)
{
  if (!(spec->flags & G_PARAM_WRITABLE))
    return "";
  GValue value = G_VALUE_INIT;
  g_value_init (&value, spec->value_type);
  g_object_get_property (object, spec->name, &value);
  std::string text;
  if (G_IS_PARAM_SPEC_ENUM (spec))
    text = g_enum_get_value (G_PARAM_SPEC_ENUM (spec)->enum_class, g_value_get_enum (&value))
               ->value_nick;
  else if (G_IS_PARAM_SPEC_FLAGS (spec))
    text = flags_text (G_PARAM_SPEC_FLAGS (spec)->flags_class, g_value_get_flags (&value));
  else if (G_IS_PARAM_SPEC_STRING (spec))
    text = g_value_get_string (&value) ? g_value_get_string (&value) : "unset";
  else if (G_IS_PARAM_SPEC_DOUBLE (spec))
    text = number (g_value_get_double (&value));
  else if (G_IS_PARAM_SPEC_INT (spec))
    text = number (gint64 (g_value_get_int (&value)));
  else if (G_IS_PARAM_SPEC_UINT (spec))
    text = std::string (spec->name) == "background"
               ? take (g_strdup_printf ("0x%08x", g_value_get_uint (&value)))
               : number (guint64 (g_value_get_uint (&value)));
  else if (G_IS_PARAM_SPEC_UINT64 (spec))
    text = number (g_value_get_uint64 (&value));
  else
    text = value_text (&value);
  g_value_unset (&value);
  return cell (text.c_str ());
}

const char *
changeable_text (GParamSpec *spec)
{
  if (!(spec->flags & G_PARAM_WRITABLE))
    return "read-only";
  if (spec->flags & GST_PARAM_CONTROLLABLE)
    return "any time, controllable";
  if (spec->flags & GST_PARAM_MUTABLE_PLAYING)
    return "any time";
  if (spec->flags & GST_PARAM_MUTABLE_PAUSED)
    return "up to PAUSED";
  return "READY";
}

std::string
deprecated_text (GParamSpec *spec)
{
  return spec->flags & G_PARAM_DEPRECATED ? "Deprecated. " : "";
}

std::vector<GParamSpec *>
own_properties (GObject *object)
{
  guint n = 0;
  GParamSpec **specs = g_object_class_list_properties (G_OBJECT_GET_CLASS (object), &n);
  std::vector<GParamSpec *> own;
  for (guint i = 0; i < n; i++)
    if (specs[i]->owner_type == G_OBJECT_TYPE (object))
      own.push_back (specs[i]);
  g_free (specs);
  std::sort (own.begin (), own.end (),
      [] (const auto *a, const auto *b) { return std::strcmp (a->name, b->name) < 0; });
  return own;
}

struct NamedValue {
  std::string nick, name;
};

std::vector<NamedValue>
values_of (GParamSpec *spec)
{
  std::vector<NamedValue> values;
  const auto add = [&values] (const auto *klass) {
    for (guint i = 0; i < klass->n_values; i++)
      values.push_back ({klass->values[i].value_nick, klass->values[i].value_name});
  };
  if (G_IS_PARAM_SPEC_ENUM (spec))
    add (G_PARAM_SPEC_ENUM (spec)->enum_class);
  else if (G_IS_PARAM_SPEC_FLAGS (spec))
    add (G_PARAM_SPEC_FLAGS (spec)->flags_class);
  return values;
}

/* Values of an enumeration or of flags, each with its meaning unless the nick says it. */
void
print_values (GParamSpec *spec)
{
  const auto values = values_of (spec);
  if (values.empty ())
    return;
  if (std::all_of (
          values.begin (), values.end (), [] (const auto &v) { return v.nick == v.name; })) {
    std::printf ("\nValues of `%s`:", spec->name);
    for (const auto &value : values)
      std::printf ("%s `%s`", &value == values.data () ? "" : ",", value.nick.c_str ());
    std::printf (".\n");
    return;
  }
  std::printf ("\n| value of `%s` | meaning |\n|---|---|\n", spec->name);
  for (const auto &value : values)
    std::printf ("| `%s` | %s |\n", value.nick.c_str (), cell (value.name.c_str ()).c_str ());
}

void
print_properties (GObject *object, const char *of)
{
  const auto specs = own_properties (object);
  if (specs.empty ())
    return;
  std::printf (
      "\n| %s | type, range | default | may change | description |\n|---|---|---|---|---|\n", of);
  for (const auto spec : specs)
    std::printf ("| `%s` | %s | %s | %s | %s |\n", spec->name, type_text (spec).c_str (),
        default_text (object, spec).c_str (), changeable_text (spec),
        (deprecated_text (spec) + cell (g_param_spec_get_blurb (spec))).c_str ());
  for (const auto spec : specs)
    if (!(spec->flags & G_PARAM_DEPRECATED))
      print_values (spec);
}

void
print_pad_properties (GstElementClass *klass)
{
  for (GList *item = gst_element_class_get_pad_template_list (klass); item; item = item->next) {
    auto pad_template = GST_PAD_TEMPLATE (item->data);
    GType type = G_TYPE_INVALID;
    g_object_get (pad_template, "gtype", &type, nullptr);
    if (type == G_TYPE_INVALID || type == G_TYPE_NONE || type == GST_TYPE_PAD ||
        std::strcmp (g_type_name (type), "GstAggregatorPad") == 0)
      continue;
    auto pad = G_OBJECT (g_object_ref_sink (g_object_new (type, "direction",
        GST_PAD_TEMPLATE_DIRECTION (pad_template), "template", pad_template, nullptr)));
    const std::string of =
        "property of `" + std::string (GST_PAD_TEMPLATE_NAME_TEMPLATE (pad_template)) + "`";
    print_properties (pad, of.c_str ());
    g_object_unref (pad);
  }
}

/* ---- signals ---- */

void
print_signals (GType type)
{
  guint n = 0;
  guint *ids = g_signal_list_ids (type, &n);
  if (n > 0)
    std::printf ("\n| signal | kind |\n|---|---|\n");
  for (guint i = 0; i < n; i++) {
    GSignalQuery query;
    g_signal_query (ids[i], &query);
    std::string parameters;
    for (guint k = 0; k < query.n_params; k++)
      parameters += (k ? ", " : "") + std::string (g_type_name (query.param_types[k]));
    std::printf ("| `%s (%s) -> %s` | %s |\n", query.signal_name, parameters.c_str (),
        query.return_type == G_TYPE_NONE ? "void" : g_type_name (query.return_type),
        query.signal_flags & G_SIGNAL_ACTION ? "action" : "notification");
  }
  g_free (ids);
}

void
print_names ()
{
  GList *features = gst_registry_get_feature_list (gst_registry_get (), GST_TYPE_ELEMENT_FACTORY);
  for (GList *item = features; item; item = item->next) {
    auto feature = GST_PLUGIN_FEATURE (item->data);
    GstPlugin *plugin = gst_plugin_feature_get_plugin (feature);
    if (plugin && g_str_equal (gst_plugin_get_source (plugin), "gst-rangecast"))
      std::printf ("%s\n", gst_plugin_feature_get_name (feature));
    gst_clear_object (&plugin);
  }
  gst_plugin_feature_list_free (features);
}

} // namespace

int
main (int argc, char **argv)
{
  gst_init (&argc, &argv);
  if (argc == 1) {
    print_names ();
    return 0;
  }
  auto element = gst_element_factory_make (argv[1], nullptr);
  if (!element) {
    std::fprintf (stderr, "element-tables: there is no element %s\n", argv[1]);
    return 1;
  }
  gst_object_ref_sink (element);
  const auto klass = GST_ELEMENT_GET_CLASS (element);
  print_pads (klass);
  print_properties (G_OBJECT (element), "property");
  print_pad_properties (klass);
  print_signals (G_OBJECT_TYPE (element));
  gst_object_unref (element);
  return 0;
}
