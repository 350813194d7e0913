/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

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

/** What an application wants of cylinderfilter. Any thread, under the element's lock. */
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
};

/** Their properties. */
PropertyTable<CylinderFilterSettings> &cylinder_properties ();

/** Writes x, y and z into a GstValueArray of doubles. */
void set_vector (GValue *array, const rangecast::Vec3 &vector);
