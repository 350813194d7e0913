/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

/** Deactivates and unrefs a pool, whether created here or offered by a peer, and clears the
 *  pointer, which may be null. */
inline void
drop_pool (GstBufferPool *&pool)
{
  if (pool)
    gst_buffer_pool_set_active (pool, FALSE);
  gst_clear_object (&pool);
}
