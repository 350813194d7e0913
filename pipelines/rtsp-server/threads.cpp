/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "threads.hpp"

G_BEGIN_DECLS
struct ServingThreads {
  GstRTSPThreadPool parent;
  ThreadOfClient *on_client;
};
struct ServingThreadsClass {
  GstRTSPThreadPoolClass parent_class;
};
G_END_DECLS
G_DEFINE_TYPE (ServingThreads, serving_threads, GST_TYPE_RTSP_THREAD_POOL)

static GstRTSPThread *
serving_threads_get_thread (
    GstRTSPThreadPool *pool, GstRTSPThreadType type, GstRTSPContext *context)
{
  GstRTSPThread *thread =
      GST_RTSP_THREAD_POOL_CLASS (serving_threads_parent_class)->get_thread (pool, type, context);
  if (thread && type == GST_RTSP_THREAD_TYPE_CLIENT && context && context->client)
    (*reinterpret_cast<ServingThreads *> (pool)->on_client) (context->client, thread);
  return thread;
}

static void
serving_threads_init (ServingThreads *threads)
{
  threads->on_client = new ThreadOfClient;
}

static void
serving_threads_finalize (GObject *object)
{
  delete reinterpret_cast<ServingThreads *> (object)->on_client;
  G_OBJECT_CLASS (serving_threads_parent_class)->finalize (object);
}

static void
serving_threads_class_init (ServingThreadsClass *klass)
{
  G_OBJECT_CLASS (klass)->finalize = serving_threads_finalize;
  GST_RTSP_THREAD_POOL_CLASS (klass)->get_thread = serving_threads_get_thread;
}

void
end_threads ()
{
  auto klass =
      static_cast<GstRTSPThreadPoolClass *> (g_type_class_peek (serving_threads_get_type ()));
  GThreadPool *threads = klass ? klass->pool : nullptr;
  if (!threads)
    return;
  klass->pool = nullptr;
  g_thread_pool_free (threads, FALSE, TRUE);
}

GstRTSPThreadPool *
make_thread_pool (int n, ThreadOfClient on_client)
{
  auto threads =
      static_cast<ServingThreads *> (g_object_new (serving_threads_get_type (), nullptr));
  *threads->on_client = std::move (on_client);
  gst_rtsp_thread_pool_set_max_threads (GST_RTSP_THREAD_POOL (threads), n);
  return GST_RTSP_THREAD_POOL (threads);
}
