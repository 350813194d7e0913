/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* ThreadSanitizer does not see the locks of GLib, which is built without it, and takes what they
 * guard for races: among it all that a thread hands to OpenGL's. Preloaded, this tells it of them.
 *
 *   gcc -shared -fPIC -fsanitize=thread tests/tsan-glib.c -o build-tsan/tsan-glib.so \
 *     $(pkg-config --cflags --libs glib-2.0)
 *   LD_PRELOAD=build-tsan/tsan-glib.so G_SLICE=always-malloc GST_REGISTRY_FORK=no CK_FORK=no \
 *     TSAN_OPTIONS="suppressions=tests/tsan.supp ignore_noninstrumented_modules=1" \
 *     build-tsan/tests/check/check_striprender
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <glib.h>
#include <sanitizer/tsan_interface.h>

#define GLIBS(name)                                                                                \
  static __typeof__ (&name) found;                                                                 \
  __typeof__ (&name) glibs = __atomic_load_n (&found, __ATOMIC_RELAXED);                           \
  if (!glibs) {                                                                                    \
    glibs = (__typeof__ (&name))dlsym (RTLD_NEXT, #name);                                          \
    __atomic_store_n (&found, glibs, __ATOMIC_RELAXED);                                            \
  }                                                                                                \
  (void)0

void
g_mutex_lock (GMutex *mutex)
{
  GLIBS (g_mutex_lock);
  glibs (mutex);
  __tsan_acquire (mutex);
}

gboolean
g_mutex_trylock (GMutex *mutex)
{
  GLIBS (g_mutex_trylock);
  const gboolean locked = glibs (mutex);
  if (locked)
    __tsan_acquire (mutex);
  return locked;
}

void
g_mutex_unlock (GMutex *mutex)
{
  GLIBS (g_mutex_unlock);
  __tsan_release (mutex);
  glibs (mutex);
}

void
g_cond_wait (GCond *cond, GMutex *mutex)
{
  GLIBS (g_cond_wait);
  __tsan_release (mutex);
  glibs (cond, mutex);
  __tsan_acquire (mutex);
}

gboolean
g_cond_wait_until (GCond *cond, GMutex *mutex, gint64 end_time)
{
  GLIBS (g_cond_wait_until);
  __tsan_release (mutex);
  const gboolean signalled = glibs (cond, mutex, end_time);
  __tsan_acquire (mutex);
  return signalled;
}

void
g_async_queue_push (GAsyncQueue *queue, gpointer data)
{
  GLIBS (g_async_queue_push);
  __tsan_release (queue);
  glibs (queue, data);
}

gpointer
g_async_queue_try_pop (GAsyncQueue *queue)
{
  GLIBS (g_async_queue_try_pop);
  gpointer data = glibs (queue);
  __tsan_acquire (queue);
  return data;
}

gpointer
g_async_queue_timeout_pop (GAsyncQueue *queue, guint64 timeout)
{
  GLIBS (g_async_queue_timeout_pop);
  gpointer data = glibs (queue, timeout);
  __tsan_acquire (queue);
  return data;
}

gpointer
g_async_queue_pop (GAsyncQueue *queue)
{
  GLIBS (g_async_queue_pop);
  gpointer data = glibs (queue);
  __tsan_acquire (queue);
  return data;
}

/* What a main loop is to call: all that OpenGL's thread does. */
struct Callback {
  GSourceFunc func;
  gpointer data;
  GDestroyNotify notify;
};

static gboolean
call (gpointer user_data)
{
  struct Callback *callback = user_data;
  __tsan_acquire (callback);
  return callback->func (callback->data);
}

static void
forget (gpointer user_data)
{
  struct Callback *callback = user_data;
  if (callback->notify)
    callback->notify (callback->data);
  g_free (callback);
}

void
g_source_set_callback (GSource *source, GSourceFunc func, gpointer data, GDestroyNotify notify)
{
  GLIBS (g_source_set_callback);
  if (source->source_funcs != &g_idle_funcs) { /* whose functions take other arguments */
    glibs (source, func, data, notify);
    return;
  }
  struct Callback *callback = g_new (struct Callback, 1);
  *callback = (struct Callback){func, data, notify};
  __tsan_release (callback);
  glibs (source, call, callback, forget);
}

/* What a thread of GStreamer's pool is to call, to which GLib hands it. Declared here, to need no
 * headers of GStreamer's. */
typedef void (*ElementFunc) (gpointer element, gpointer data);
void gst_element_call_async (
    gpointer element, ElementFunc func, gpointer data, GDestroyNotify notify);

struct ElementCall {
  ElementFunc func;
  gpointer data;
  GDestroyNotify notify;
};

static void
call_element (gpointer element, gpointer user_data)
{
  struct ElementCall *element_call = user_data;
  __tsan_acquire (element_call);
  element_call->func (element, element_call->data);
}

static void
forget_element_call (gpointer user_data)
{
  struct ElementCall *element_call = user_data;
  __tsan_acquire (element_call);
  if (element_call->notify)
    element_call->notify (element_call->data);
  g_free (element_call);
}

void
gst_element_call_async (gpointer element, ElementFunc func, gpointer data, GDestroyNotify notify)
{
  GLIBS (gst_element_call_async);
  struct ElementCall *element_call = g_new (struct ElementCall, 1);
  *element_call = (struct ElementCall){func, data, notify};
  __tsan_release (element_call);
  glibs (element, call_element, element_call, forget_element_call);
}
