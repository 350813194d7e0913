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
        {int (rangecast::Profile::kEntropy), "Context model and range coder", "entropy"}, {}};
    return g_enum_register_static ("GstNeighbourCodeProfile", values);
  }();
  return type;
}

GType
gst_neighbour_code_choice_get_type (void)
{
  static const GType type = [] {
    static const GEnumValue values[] = {
        {int (rangecast::NeighbourChoice::kFirst),
            "First neighbour in the order left, upper-left, upper, upper-right", "first"},
        {int (rangecast::NeighbourChoice::kBest),
            "Neighbour with the least cost in error and bits; slower", "best"},
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
        {int (rangecast::DepthScale::kLinear), "Linear in depth", "linear"},
        {int (rangecast::DepthScale::kInverse),
            "Linear in 1/depth, as the errors of stereo cameras", "inverse"},
        {}};
    return g_enum_register_static ("GstNeighbourCodeDepthScale", values);
  }();
  return type;
}
