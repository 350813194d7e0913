/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "limitedinput.h"

struct _WebLimitedInput {
  GFilterInputStream parent;
  gsize limit, count;
};

static void init_pollable (GPollableInputStreamInterface *interface);

G_DEFINE_FINAL_TYPE_WITH_CODE (WebLimitedInput, web_limited_input, G_TYPE_FILTER_INPUT_STREAM,
    G_IMPLEMENT_INTERFACE (G_TYPE_POLLABLE_INPUT_STREAM, init_pollable))

static GInputStream *
base_of (gpointer stream)
{
  return g_filter_input_stream_get_base_stream (G_FILTER_INPUT_STREAM (stream));
}

static gssize
count (gpointer stream, gssize size, GError **error)
{
  auto self = WEB_LIMITED_INPUT (stream);
  self->count += size > 0 ? gsize (size) : 0;
  if (self->count <= self->limit)
    return size;
  g_set_error (error, G_IO_ERROR, G_IO_ERROR_MESSAGE_TOO_LARGE,
      "more than %" G_GSIZE_FORMAT " bytes without a whole message", self->limit);
  return -1;
}

static gssize
web_limited_input_read (
    GInputStream *stream, void *to, gsize size, GCancellable *cancellable, GError **error)
{
  const gssize got = g_input_stream_read (base_of (stream), to, size, cancellable, error);
  return got < 0 ? got : count (stream, got, error);
}

static gboolean
web_limited_input_can_poll (GPollableInputStream *stream)
{
  return g_pollable_input_stream_can_poll (G_POLLABLE_INPUT_STREAM (base_of (stream)));
}

static gboolean
web_limited_input_is_readable (GPollableInputStream *stream)
{
  return g_pollable_input_stream_is_readable (G_POLLABLE_INPUT_STREAM (base_of (stream)));
}

static GSource *
web_limited_input_create_source (GPollableInputStream *stream, GCancellable *cancellable)
{
  GSource *base = g_pollable_input_stream_create_source (
      G_POLLABLE_INPUT_STREAM (base_of (stream)), cancellable);
  GSource *source = g_pollable_source_new_full (stream, base, cancellable);
  g_source_unref (base);
  return source;
}

static gssize
web_limited_input_read_nonblocking (
    GPollableInputStream *stream, void *to, gsize size, GError **error)
{
  const gssize got = g_pollable_input_stream_read_nonblocking (
      G_POLLABLE_INPUT_STREAM (base_of (stream)), to, size, nullptr, error);
  return got < 0 ? got : count (stream, got, error);
}

static void
init_pollable (GPollableInputStreamInterface *interface)
{
  interface->can_poll = web_limited_input_can_poll;
  interface->is_readable = web_limited_input_is_readable;
  interface->create_source = web_limited_input_create_source;
  interface->read_nonblocking = web_limited_input_read_nonblocking;
}

static void
web_limited_input_class_init (WebLimitedInputClass *klass)
{
  G_INPUT_STREAM_CLASS (klass)->read_fn = web_limited_input_read;
}

static void
web_limited_input_init (WebLimitedInput *)
{
}

WebLimitedInput *
web_limited_input_new (GInputStream *base, gsize limit)
{
  auto self = WEB_LIMITED_INPUT (g_object_new (
      WEB_TYPE_LIMITED_INPUT, "base-stream", base, "close-base-stream", FALSE, nullptr));
  self->limit = limit;
  return self;
}

void
web_limited_input_restart (WebLimitedInput *self)
{
  self->count = 0;
}
