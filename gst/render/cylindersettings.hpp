/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <rangecast/alignment/view_agreement.hpp>
#include <rangecast/overlap/colour_match.hpp>
#include <rangecast/overlap/cylinder_filter.hpp>

#include "common/properties.hpp"

enum GstCylinderFilterMode {
  GST_CYLINDER_FILTER_OFF,
  GST_CYLINDER_FILTER_WINNER,
  GST_CYLINDER_FILTER_BLEND
};
enum GstCylinderFilterAgree {
  GST_CYLINDER_FILTER_AGREE_POSES = 1,
  GST_CYLINDER_FILTER_AGREE_DEPTH = 2,
  GST_CYLINDER_FILTER_AGREE_VIEWS = 4,
  GST_CYLINDER_FILTER_AGREE_POINTS = 8
};
enum GstCylinderFilterBalance { GST_CYLINDER_FILTER_BALANCE_OFF, GST_CYLINDER_FILTER_BALANCE_AUTO };

/** cylinderfilter's properties. Any thread, under the element's lock. */
struct CylinderFilterSettings {
  GstCylinderFilterMode mode = GST_CYLINDER_FILTER_WINNER;
  rangecast::CylinderSettings core; ///< with an overlap for blending and a thread per core
  GstCylinderFilterBalance balance = GST_CYLINDER_FILTER_BALANCE_AUTO;
  double blend_width_m = 0.02;
  guint consistency = GST_CYLINDER_FILTER_AGREE_POSES | GST_CYLINDER_FILTER_AGREE_VIEWS |
                      GST_CYLINDER_FILTER_AGREE_POINTS; ///< GstCylinderFilterAgree

  CylinderFilterSettings ()
  {
    core.overlap = 8;
    core.threads = 0;
  }
  [[nodiscard]] rangecast::AgreementSettings agreement () const;
  [[nodiscard]] rangecast::ColourSettings colours () const;
};

/** Their table. */
PropertyTable<CylinderFilterSettings> &cylinder_properties ();

/** Writes x, y and z into a GstValueArray of doubles. */
void set_vector (GValue *array, const rangecast::Vec3 &vector);
