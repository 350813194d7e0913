/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The key of SRTP, from a file: on a command line everybody on the machine could read it. */
#pragma once

#include <gst/gst.h>

/** Gives the key in `path` (60 hexadecimal digits: 16 bytes of key, 14 of salt) to every srtpenc
 *  and srtpdec of a pipeline. When packets cannot be decrypted with it, one warning is printed to
 *  stderr until a packet can.
 *  @return whether the file holds a key, and all have it; if not, an error is printed to stderr */
bool give_srtp_key (GstElement *pipeline, const char *path);
