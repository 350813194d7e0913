/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "enums.hpp"

#include <rangecast/neighbourcode/encoder.hpp>

GType
gst_neighbour_code_profile_get_type (void)
{
  static const GType type = [] {
    static const GEnumValue values[] = {
        {int (rangecast::Profile::kPlain), "Fixed-length codes, no entropy coding", "plain"},
        {int (rangecast::Profile::kPacked), "Run lengths and fixed prefix codes", "packed"},
        {int (rangecast::Profile::kEntropy), "Adaptive probabilities and a range coder", "entropy"},
        {}};
    return g_enum_register_static ("GstNeighbourCodeProfile", values);
  }();
  return type;
}

GType
gst_neighbour_code_choice_get_type (void)
{
  static const GType type = [] {
    static const GEnumValue values[] = {
        {int (rangecast::NeighbourChoice::kFirst), "Left, upper-left, upper, upper-right", "first"},
        {int (rangecast::NeighbourChoice::kBest), "What costs least in error and bits, slower",
            "best"},
        {}};
    return g_enum_register_static ("GstNeighbourCodeChoice", values);
  }();
  return type;
}

GType
gst_neighbour_code_depth_scale_get_type (void)
{
  static const GType type = [] {
    static const GEnumValue values[] = {
        {int (rangecast::DepthScale::kLinear), "Codes are linear in depth", "linear"},
        {int (rangecast::DepthScale::kInverse), "Codes are linear in 1/depth", "inverse"}, {}};
    return g_enum_register_static ("GstNeighbourCodeDepthScale", values);
  }();
  return type;
}
