/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* A rangewebsink in a harness, and clients of it: WebSockets by libsoup, and plain TCP for what
 * libsoup would not send. All of them run on the test's thread; the server has its own. */
#pragma once

#include <gio/gnetworking.h>
#include <glib/gstdio.h>
#include <gst/video/video.h>
#include <libsoup/soup.h>

#include <functional>
#include <memory>

#include "../coded-check.hpp"

namespace rangecast::testing {

/** How long a test waits for what must happen; valgrind is slow. */
inline constexpr gint64 kPatience_us = 30 * G_USEC_PER_SEC;

/** The main context of the test's thread, for sessions and sockets. */
struct TestContext {
  GMainContext *context = g_main_context_new ();

  TestContext () { g_main_context_push_thread_default (context); }
  TestContext (const TestContext &) = delete;
  TestContext &operator= (const TestContext &) = delete;
  ~TestContext ()
  {
    while (g_main_context_iteration (context, FALSE)) { /* what sessions left */
    }
    g_main_context_pop_thread_default (context);
    g_main_context_unref (context);
  }
};

/** Runs the thread's main context until something has happened. @return false if it did not */
inline bool
happens (const std::function<bool ()> &what, gint64 patience_us = kPatience_us)
{
  GMainContext *context = g_main_context_get_thread_default ();
  const gint64 end = g_get_monotonic_time () + patience_us;
  while (!what ()) {
    if (g_get_monotonic_time () > end)
      return false;
    if (!g_main_context_iteration (context, FALSE))
      g_usleep (500);
  }
  return true;
}

#define fail_unless_happens(...)                                                                   \
  fail_unless (rangecast::testing::happens ([&] { return bool (__VA_ARGS__); }),                   \
      "did not happen: %s", #__VA_ARGS__)

/** A folder that is removed with what is in it. */
struct Folder {
  std::string path;

  Folder ()
  {
    g_autofree gchar *made = g_dir_make_tmp ("rangewebsink-XXXXXX", nullptr);
    path = made;
  }
  Folder (const Folder &) = delete;
  Folder &operator= (const Folder &) = delete;
  ~Folder () { remove_tree (path); }
  /** @return its path */
  std::string write (const std::string &name, const std::string &contents) const
  {
    const std::string file = path + "/" + name;
    g_autofree gchar *folder = g_path_get_dirname (file.c_str ());
    g_mkdir_with_parents (folder, 0700);
    fail_unless (
        g_file_set_contents (file.c_str (), contents.data (), gssize (contents.size ()), nullptr));
    return file;
  }

private:
  static void remove_tree (const std::string &path)
  {
    if (g_autoptr (GDir) dir = g_dir_open (path.c_str (), 0, nullptr))
      while (const gchar *name = g_dir_read_name (dir))
        remove_tree (path + "/" + name);
    g_remove (path.c_str ());
  }
};

/** The port of an address as http://127.0.0.1:PORT/. */
inline guint16
port_of (const std::string &url)
{
  gint port = 0;
  g_uri_split_network (url.c_str (), G_URI_FLAGS_NONE, nullptr, nullptr, &port, nullptr);
  return guint16 (port);
}

/** A playing rangewebsink at a free port, with a page of its own, in a harness. */
struct WebSink {
  TestContext context;
  Folder root;
  GstBus *bus = gst_bus_new ();
  GstHarness *h;
  Rig rig = ring_rig (2, 32, 24);
  std::string url;
  guint pushed = 0;

  /** @param properties  of a launch string */
  explicit WebSink (const std::string &properties = "", bool with_caps = true)
  {
    root.write ("index.html", "<title>page</title>");
    GstElement *element = gst_parse_launch (
        ("rangewebsink port=0 sync=false stats-interval=0 root=" + root.path + " " + properties)
            .c_str (),
        nullptr);
    fail_unless (element != nullptr);
    gst_element_set_bus (element, bus);
    h = gst_harness_new_with_element (element, "sink", nullptr);
    gst_object_unref (element);
    gst_harness_play (h);
    g_autofree gchar *text = nullptr;
    g_object_get (h->element, "url", &text, nullptr);
    fail_unless (text != nullptr);
    url = text;
    if (with_caps)
      set_caps ();
  }
  WebSink (const WebSink &) = delete;
  WebSink &operator= (const WebSink &) = delete;
  ~WebSink ()
  {
    fail_unless_equals_int (errors (), 0);
    gst_element_set_bus (h->element, nullptr);
    gst_object_unref (bus);
    gst_harness_teardown (h);
  }
  guint16 port () const { return port_of (url); }
  void set_caps () { gst_harness_set_src_caps (h, coded_caps (rig)); }
  void stop () { gst_element_set_state (h->element, GST_STATE_NULL); }
  /** Since the last call. */
  int errors ()
  {
    int n = 0;
    for (; GstMessage *message = gst_bus_pop_filtered (bus, GST_MESSAGE_ERROR); n++)
      gst_message_unref (message);
    return n;
  }
  /** Pushes a frame set of those bytes. */
  void push (const std::string &bytes, bool key = true)
  {
    GstBuffer *buffer =
        bytes.empty () ? gst_buffer_new () : gst_buffer_new_memdup (bytes.data (), bytes.size ());
    GST_BUFFER_PTS (buffer) = pushed++ * GST_SECOND / 30;
    if (!key)
      GST_BUFFER_FLAG_SET (buffer, GST_BUFFER_FLAG_DELTA_UNIT);
    fail_unless_equals_int (gst_harness_push (h, buffer), GST_FLOW_OK);
  }
  GstStructure *stats () const
  {
    GstStructure *stats = nullptr;
    g_object_get (h->element, "server-stats", &stats, nullptr);
    return stats;
  }
  /** A counter of the server-stats property. */
  guint64 stat (const char *name) const
  {
    GstStructure *all = stats ();
    guint64 number = 0;
    guint small = 0;
    if (gst_structure_get_uint (all, name, &small))
      number = small;
    else
      fail_unless (gst_structure_get_uint64 (all, name, &number), "%s", name);
    gst_structure_free (all);
    return number;
  }
  /** Force key unit events that the server has sent upstream since the last call; waits for them.
   */
  int key_requests ()
  {
    const guint64 before = key_requests_;
    fail_unless_happens ([&] {
      while (GstEvent *event = gst_harness_try_pull_upstream_event (h)) {
        key_requests_ += gst_video_event_is_force_key_unit (event);
        gst_event_unref (event);
      }
      return key_requests_ == stat ("key-requests");
    }());
    return int (key_requests_ - before);
  }

private:
  guint64 key_requests_ = 0;
};

/** A message of a frame set. */
struct WebFrame {
  std::string bytes;

  guint kind () const { return guint8 (bytes[0]); }
  bool key () const { return bytes[1] & 1; }
  bool discontinuity () const { return bytes[1] & 2; }
  guint32 number () const { return GST_READ_UINT32_LE (bytes.data () + 4); }
  guint32 dropped () const { return GST_READ_UINT32_LE (bytes.data () + 8); }
  guint32 delay_us () const { return GST_READ_UINT32_LE (bytes.data () + 12); }
  std::string units () const { return bytes.substr (24); }
};

/** A WebSocket by libsoup. */
class WebClient {
public:
  bool acknowledges = true;
  std::vector<std::string> texts; ///< other than pongs
  std::vector<WebFrame> frames;
  std::size_t frames_before_texts = 0;
  bool closed = false;
  int code = 0;       ///< why it was closed; 1006: without a reason
  std::string reason; ///< in words
  guint status = 0;   ///< HTTP status, 101 if it became a WebSocket

  explicit WebClient (
      WebSink &sink, const char *origin = nullptr, const char *protocol = "rangecast.v1")
      : session_ (soup_session_new ())
  {
    SoupMessage *message = soup_message_new ("GET", (sink.url + "stream").c_str ());
    const char *protocols[] = {protocol, nullptr};
    bool done = false;
    const auto connected = [] (GObject *session, GAsyncResult *result, gpointer data) {
      auto [self, flag] = *static_cast<std::pair<WebClient *, bool *> *> (data);
      self->socket_ =
          soup_session_websocket_connect_finish (SOUP_SESSION (session), result, nullptr);
      *flag = true;
    };
    std::pair<WebClient *, bool *> data (this, &done);
    soup_session_websocket_connect_async (session_, message, origin,
        protocol ? const_cast<char **> (protocols) : nullptr, 0, nullptr, connected, &data);
    fail_unless_happens (done);
    status = soup_message_get_status (message);
    g_object_unref (message);
    if (!socket_)
      return;
    soup_websocket_connection_set_max_incoming_payload_size (socket_, 0);
    g_signal_connect (socket_, "message", G_CALLBACK (on_message), this);
    g_signal_connect (socket_, "closed", G_CALLBACK (on_closed), this);
  }
  WebClient (const WebClient &) = delete;
  WebClient &operator= (const WebClient &) = delete;
  ~WebClient ()
  {
    if (socket_) {
      close ();
      happens ([this] { return closed; }, G_USEC_PER_SEC);
      g_signal_handlers_disconnect_by_data (socket_, this);
      g_object_unref (socket_);
    }
    soup_session_abort (session_);
    g_object_unref (session_);
  }
  bool is_open () const
  {
    return socket_ && soup_websocket_connection_get_state (socket_) == SOUP_WEBSOCKET_STATE_OPEN;
  }
  void close ()
  {
    if (is_open ())
      soup_websocket_connection_close (socket_, 1000, nullptr);
  }
  void send (const std::string &text)
  {
    if (is_open ())
      soup_websocket_connection_send_text (socket_, text.c_str ());
  }
  void send_binary (const std::string &bytes)
  {
    soup_websocket_connection_send_binary (socket_, bytes.data (), bytes.size ());
  }
  /** @param fields  e.g. "token":"x" */
  void send_hello (const std::string &fields = "")
  {
    send (R"({"type":"hello","version":1)" + (fields.empty () ? "" : "," + fields) + "}");
  }
  void acknowledge (guint32 number)
  {
    send (R"({"type":"ack","frameSet":)" + std::to_string (number) + "}");
  }
  /** Waits until the server has handled all that was sent and pushed, and all that it sent before
   * is here. Twice: what was pushed and the first ping may be handled in any order. */
  void round_trip ()
  {
    for (int i = 0; i < 2; i++) {
      const guint expected = ++pings_;
      send (R"({"type":"ping","time":)" + std::to_string (expected) + "}");
      fail_unless_happens (pongs_ == expected || closed);
      fail_if (closed, "closed: %d %s", code, reason.c_str ());
    }
  }
  /** Introduces itself and waits for the welcome. */
  void enter (const std::string &fields = "")
  {
    send_hello (fields);
    fail_unless_happens (!texts.empty () || closed);
    fail_if (closed, "closed: %d %s", code, reason.c_str ());
    fail_unless_contains (texts[0], R"("type":"welcome")");
  }
  /** Waits for a frame set with these units, at the end, and until its acknowledgement is there. */
  void wait_for (const std::string &units)
  {
    fail_unless_happens (closed || (!frames.empty () && frames.back ().bytes.ends_with (units)));
    fail_if (closed, "closed: %d %s", code, reason.c_str ());
    round_trip ();
  }
  int close_code ()
  {
    fail_unless_happens (closed);
    return code;
  }

private:
  static void on_message (SoupWebsocketConnection *, gint type, GBytes *message, gpointer data)
  {
    auto self = static_cast<WebClient *> (data);
    gsize size = 0;
    const auto bytes = static_cast<const char *> (g_bytes_get_data (message, &size));
    std::string text (bytes ? bytes : "", size);
    if (type == SOUP_WEBSOCKET_DATA_TEXT) {
      if (text.starts_with (R"({"type":"pong")")) {
        self->pongs_++;
        return;
      }
      if (self->texts.empty ())
        self->frames_before_texts = self->frames.size ();
      self->texts.push_back (text);
      return;
    }
    fail_unless_cmp (size, >=, gsize (24));
    self->frames.push_back ({std::move (text)});
    if (self->acknowledges)
      self->acknowledge (self->frames.back ().number ());
  }
  static void on_closed (SoupWebsocketConnection *socket, gpointer data)
  {
    auto self = static_cast<WebClient *> (data);
    self->closed = true;
    self->code = soup_websocket_connection_get_close_code (socket);
    if (self->code == 0)
      self->code = 1006;
    const char *text = soup_websocket_connection_get_close_data (socket);
    self->reason = text ? text : "";
  }

  SoupSession *session_;
  SoupWebsocketConnection *socket_ = nullptr;
  guint pings_ = 0, pongs_ = 0;
};

/** A TCP connection. */
class RawClient {
public:
  explicit RawClient (guint16 port)
  {
    g_autoptr (GSocketClient) client = g_socket_client_new ();
    g_socket_client_set_timeout (client, 30);
    connection_ = g_socket_client_connect_to_host (client, "127.0.0.1", port, nullptr, nullptr);
  }
  RawClient (const RawClient &) = delete;
  RawClient &operator= (const RawClient &) = delete;
  ~RawClient () { close (); }
  bool is_connected () const { return connection_ != nullptr; }
  void close () { g_clear_object (&connection_); }
  /** So that the other side receives a reset instead of an end. */
  void reset ()
  {
    struct {
      int on = 1, seconds = 0;
    } linger;
    GSocket *socket = g_socket_connection_get_socket (connection_);
    setsockopt (g_socket_get_fd (socket), SOL_SOCKET, SO_LINGER, &linger, sizeof linger);
    close ();
  }
  /** @return false if the connection has ended */
  bool send (const std::string &bytes)
  {
    GOutputStream *stream = g_io_stream_get_output_stream (G_IO_STREAM (connection_));
    return g_output_stream_write_all (
        stream, bytes.data (), bytes.size (), nullptr, nullptr, nullptr);
  }
  /** What comes until the text, or until the end. */
  std::string receive (const std::string &until = "")
  {
    GInputStream *stream = g_io_stream_get_input_stream (G_IO_STREAM (connection_));
    std::string text;
    gchar buffer[4096];
    while (until.empty () || text.find (until) == text.npos) {
      g_autoptr (GError) error = nullptr;
      const gssize got = g_input_stream_read (stream, buffer, sizeof buffer, nullptr, &error);
      fail_if (g_error_matches (error, G_IO_ERROR, G_IO_ERROR_TIMED_OUT), "the connection is open");
      if (got <= 0)
        break;
      text.append (buffer, gsize (got));
    }
    return text;
  }
  /** Becomes a WebSocket. */
  void upgrade ()
  {
    fail_unless (send ("GET /stream HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: Upgrade\r\n"
                       "Upgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
                       "Sec-WebSocket-Protocol: rangecast.v1\r\n"
                       "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"));
    fail_unless_contains (receive ("\r\n\r\n"), "101 Switching");
  }

private:
  GSocketConnection *connection_;
};

/** A WebSocket frame of a client. @param first  FIN and opcode, e.g. 0x81 for a whole text */
inline std::string
masked_frame (guint8 first, const std::string &payload)
{
  std::string frame (1, char (first));
  const gsize size = payload.size ();
  if (size < 126)
    frame += char (0x80 | size);
  else if (size < 65536)
    frame += {char (0xfe), char (size >> 8), char (size)};
  else {
    frame += char (0xff);
    for (int shift = 56; shift >= 0; shift -= 8)
      frame += char (size >> shift);
  }
  return frame + std::string (4, '\0') + payload; /* a mask of zeros */
}

} // namespace rangecast::testing
