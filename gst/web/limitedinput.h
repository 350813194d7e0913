/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gio/gio.h>

G_BEGIN_DECLS

/* An input stream that fails when more bytes come than its owner expects: libsoup 3.2 keeps the
 * fragments of a message, however many a client sends. It is pollable, as its base must be. */
#define WEB_TYPE_LIMITED_INPUT (web_limited_input_get_type ())
G_DECLARE_FINAL_TYPE (WebLimitedInput, web_limited_input, WEB, LIMITED_INPUT, GFilterInputStream)

/** @param limit  bytes between two calls of web_limited_input_restart() */
WebLimitedInput *web_limited_input_new (GInputStream *base, gsize limit);
void web_limited_input_restart (WebLimitedInput *self);

G_END_DECLS
