/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include <exception>
#include <new>

#include "striprenderprivate.hpp"

GstFlowReturn
strip_flow_of_exception (GstStripRender *self)
{
  try {
    throw;
  } catch (const std::bad_alloc &) {
    GST_ELEMENT_ERROR (self, RESOURCE, NO_SPACE_LEFT,
        ("There is not enough memory to draw the frame set"), (nullptr));
  } catch (const std::exception &error) {
    GST_ELEMENT_ERROR (
        self, LIBRARY, FAILED, ("The frame set cannot be drawn: %s", error.what ()), (nullptr));
  } catch (...) {
    GST_ELEMENT_ERROR (self, LIBRARY, FAILED, ("The frame set cannot be drawn"), (nullptr));
  }
  return GST_FLOW_ERROR;
}
