/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Serves the coded frame sets of a launch string over RTSP: one run for all viewers, by UDP,
 * multicast or interleaved in the RTSP connection, with digest authentication, TLS and
 * retransmission as gst-rtsp-server has them. docs/guide/streaming.md lists what version 1.22 gets
 * wrong.
 *
 * Added to the library: a payloader where the launch string has none, a key frame set for each new
 * viewer, viewers of a stream that is over are disconnected, and slow TCP viewers stop nobody else.
 *
 * Threads: everything runs in the main loop, except for the launch string and the messages of its
 * bus, which a thread of the media handles. SIGINT and SIGTERM end the process as they do by
 * default: the main loop waits up to 20 s for a first frame set, and there is nothing to save. */
#include <gst/rtsp-server/rtsp-server.h>
#include <gst/video/video.h>

#include <atomic>
#include <clocale>
#include <cstdio>
#include <fstream>
#include <map>
#include <regex>
#include <sstream>
#include <string>

#include "common/dump-graph.hpp"

namespace {

constexpr char kPayloader[] = "pay0"; /* the name that gst-rtsp-server looks for */
constexpr char kViewerRole[] = "viewer";
constexpr guint kMaxRequestBody = 16384; /* bytes */
constexpr guint kCleanupInterval_s = 2;
constexpr guint kGoodbye_ms = 500; /* for RTCP BYE to reach viewers before they are disconnected */

struct Options {
  gchar *address = nullptr, *mount = nullptr, *users = nullptr, *certificate = nullptr;
  gchar *key = nullptr, *transports = nullptr, *multicast = nullptr;
  gchar **launch = nullptr;
  gint port = 8554, retransmission_ms = 0, max_viewers = 64;
};

bool
fail (const std::string &why)
{
  g_printerr ("rtsp-server: %s\n", why.c_str ());
  return false;
}

/* ---- the stream ---- */

/** The launch string with a payloader, which is appended unless it has one named pay0.
 *  @return empty after reporting why it cannot be built */
std::string
complete_launch (gchar **words)
{
  g_autofree gchar *joined = g_strjoinv (" ", words);
  g_autoptr (GError) error = nullptr;
  std::string launch = joined;
  if (launch.find (std::string ("name=") + kPayloader) == launch.npos)
    launch += std::string (" ! rtpneighbourcodepay name=") + kPayloader;
  if (GstElement *bin = gst_parse_bin_from_description_full (
          launch.c_str (), FALSE, nullptr, GST_PARSE_FLAG_FATAL_ERRORS, &error)) {
    gst_object_unref (gst_object_ref_sink (bin));
    return launch;
  }
  fail (std::string ("launch string: ") + error->message +
        "\nIt has to end in coded frame sets (neighbourcodeenc, rangemux) or in a payloader named "
        "pay0.");
  return "";
}

GstRTSPServer *the_server;        /* for the media, which has no way to it */
std::atomic<int> the_run = 1;     /* grows when the stream ends: later viewers get another media */
constexpr char kRunKey[] = "run"; /* data of a client: the run that it asked for last */
constexpr char kDiscardingKey[] = "discarding"; /* data of a stream: a transport */

/* The library leaves viewers of a stream that has ended waiting. Without viewers it stops the
 * media. Main loop. */
gboolean
disconnect_viewers (gpointer run)
{
  const auto is_of_run = [] (GstRTSPServer *, GstRTSPClient *client, gpointer ended) {
    return g_object_get_data (G_OBJECT (client), kRunKey) == ended ? GST_RTSP_FILTER_REMOVE
                                                                   : GST_RTSP_FILTER_KEEP;
  };
  gst_rtsp_server_client_filter (the_server, is_of_run, run);
  return G_SOURCE_REMOVE;
}

} // namespace

G_BEGIN_DECLS
struct LaunchMedia {
  GstRTSPMedia parent;
  int run;
};
struct LaunchMediaClass {
  GstRTSPMediaClass parent_class;
};
G_END_DECLS
G_DEFINE_TYPE (LaunchMedia, launch_media, GST_TYPE_RTSP_MEDIA)

/* The thread that posts it: where the state change fails, the library stops the media before its
 * own thread has read the message. Sources that are being stopped can fail to negotiate. */
static GstBusSyncReply
report_message (GstBus *, GstMessage *message, gpointer pipeline)
{
  dump_graph (message, "rtsp-server");
  if (GST_MESSAGE_TYPE (message) == GST_MESSAGE_ERROR &&
      GST_STATE_TARGET (pipeline) != GST_STATE_NULL) {
    g_autoptr (GError) error = nullptr;
    g_autofree gchar *details = nullptr;
    gst_message_parse_error (message, &error, &details);
    gst_object_default_error (GST_MESSAGE_SRC (message), error, details);
  }
  return GST_BUS_PASS;
}

static gboolean
launch_media_prepare (GstRTSPMedia *media, GstRTSPThread *thread)
{
  g_autoptr (GstElement) element = gst_rtsp_media_get_element (media);
  g_autoptr (GstObject) pipeline = gst_object_get_parent (GST_OBJECT (element));
  g_autoptr (GstBus) bus = gst_element_get_bus (GST_ELEMENT (pipeline));
  gst_bus_set_sync_handler (bus, report_message, pipeline, nullptr);
  return GST_RTSP_MEDIA_CLASS (launch_media_parent_class)->prepare (media, thread);
}

/* The media's thread. */
static gboolean
launch_media_handle_message (GstRTSPMedia *media, GstMessage *message)
{
  const GstMessageType type = GST_MESSAGE_TYPE (message);
  const bool is_over = type == GST_MESSAGE_ERROR || type == GST_MESSAGE_EOS;
  /* Before it is prepared, the viewer who asked for it gets the response 503. */
  int run = reinterpret_cast<LaunchMedia *> (media)->run;
  if (is_over && gst_rtsp_media_get_status (media) == GST_RTSP_MEDIA_STATUS_PREPARED &&
      the_run.compare_exchange_strong (run, run + 1))
    g_timeout_add (kGoodbye_ms, disconnect_viewers, GINT_TO_POINTER (run));
  return GST_RTSP_MEDIA_CLASS (launch_media_parent_class)->handle_message (media, message);
}

/* Version 1.22 stops a stream for everybody while all of its TCP viewers are slow, and does not
 * look for RTP that waits beside RTCP until a transport reports that it has sent something. This
 * transport always accepts data and reports it as sent. */
static GstRTSPStreamTransport *
make_discarding_transport (GstRTSPStream *stream)
{
  GstRTSPTransport *tcp = nullptr;
  gst_rtsp_transport_new (&tcp);
  tcp->trans = GST_RTSP_TRANS_RTP;
  tcp->profile = GST_RTSP_PROFILE_AVPF;
  tcp->lower_transport = GST_RTSP_LOWER_TRANS_TCP;
  tcp->destination = g_strdup ("nobody"); /* which the library compares with senders of RTCP */
  GstRTSPStreamTransport *transport = gst_rtsp_stream_transport_new (stream, tcp);
  const auto discard = [] (auto *, guint8, gpointer self) -> gboolean {
    gst_rtsp_stream_transport_message_sent (GST_RTSP_STREAM_TRANSPORT (self));
    return TRUE;
  };
  gst_rtsp_stream_transport_set_callbacks (transport, discard, discard, transport, nullptr);
  gst_rtsp_stream_transport_set_list_callbacks (transport, discard, discard, transport, nullptr);
  return transport;
}

static void
launch_media_prepared (GstRTSPMedia *media)
{
  for (guint i = 0; i < gst_rtsp_media_n_streams (media); i++) {
    GstRTSPStream *stream = gst_rtsp_media_get_stream (media, i);
    GstRTSPStreamTransport *transport = make_discarding_transport (stream);
    gst_rtsp_stream_add_transport (stream, transport);
    g_object_set_data (G_OBJECT (stream), kDiscardingKey, transport);
  }
}

/* Streams without transports can leave their pipeline. */
static void
launch_media_target_state (GstRTSPMedia *media, GstState state)
{
  for (guint i = 0; state == GST_STATE_NULL && i < gst_rtsp_media_n_streams (media); i++) {
    GstRTSPStream *stream = gst_rtsp_media_get_stream (media, i);
    gpointer transport = g_object_steal_data (G_OBJECT (stream), kDiscardingKey);
    if (transport)
      gst_rtsp_stream_remove_transport (stream, GST_RTSP_STREAM_TRANSPORT (transport));
    g_clear_object (&transport);
  }
}

static void
launch_media_init (LaunchMedia *media)
{
  media->run = the_run;
}

static void
launch_media_class_init (LaunchMediaClass *klass)
{
  GST_RTSP_MEDIA_CLASS (klass)->prepare = launch_media_prepare;
  GST_RTSP_MEDIA_CLASS (klass)->handle_message = launch_media_handle_message;
  GST_RTSP_MEDIA_CLASS (klass)->prepared = launch_media_prepared;
  GST_RTSP_MEDIA_CLASS (klass)->target_state = launch_media_target_state;
}

namespace {

/* All viewers share a run, whatever port or query their URL has. */
gchar *
run_key (GstRTSPMediaFactory *, const GstRTSPUrl *)
{
  return g_strdup_printf ("%d", the_run.load ());
}

/* Without the rig and a key frame set a new viewer sees nothing. */
void
request_key_frame_set (GstRTSPClient *, GstRTSPContext *context, gpointer)
{
  GstRTSPMedia *media = gst_rtsp_session_media_get_media (context->sessmedia);
  g_autoptr (GstElement) bin = gst_rtsp_media_get_element (media);
  g_autoptr (GstElement) payloader = gst_bin_get_by_name (GST_BIN (bin), kPayloader);
  if (payloader)
    gst_element_send_event (
        payloader, gst_video_event_new_upstream_force_key_unit (GST_CLOCK_TIME_NONE, TRUE, 0));
}

void
record_run (GstRTSPClient *client, GstRTSPContext *context, gpointer)
{
  const int run = reinterpret_cast<LaunchMedia *> (context->media)->run;
  g_object_set_data (G_OBJECT (client), kRunKey, GINT_TO_POINTER (run));
}

void
on_connected (GstRTSPServer *, GstRTSPClient *client, gpointer)
{
  g_signal_connect (client, "describe-request", G_CALLBACK (record_run), nullptr);
  g_signal_connect (client, "play-request", G_CALLBACK (request_key_frame_set), nullptr);
}

/* ---- transports ---- */

bool
set_multicast (GstRTSPMediaFactory *factory, const std::string &text)
{
  static const std::regex form ("([0-9.]+)(-([0-9.]+))?:([0-9]{1,5})-([0-9]{1,5})(/([0-9]{1,3}))?");
  std::smatch match;
  g_autoptr (GstRTSPAddressPool) pool = gst_rtsp_address_pool_new ();
  bool good = std::regex_match (text, match, form);
  if (good) {
    const std::string first = match[1], last = match[3].matched ? match[3] : match[1];
    const int first_port = std::stoi (match[4]), last_port = std::stoi (match[5]);
    const int ttl = match[7].matched ? std::stoi (match[7]) : 1;
    good = first_port > 0 && first_port % 2 == 0 && first_port < last_port &&
           last_port <= G_MAXUINT16 && ttl > 0 && ttl <= G_MAXUINT8 &&
           gst_rtsp_address_pool_add_range (pool, first.c_str (), last.c_str (),
               guint16 (first_port), guint16 (last_port), guint8 (ttl));
  }
  gst_rtsp_media_factory_set_address_pool (factory, pool);
  return good || fail ("--multicast takes ADDRESS[-ADDRESS]:PORT-PORT[/TTL] with at least two "
                       "ports, the first even, such as 239.1.2.3:5000-5001/1, not '" +
                       text + "'");
}

bool
set_transports (GstRTSPMediaFactory *factory, const Options &options)
{
  static const std::map<std::string, int> known = {{"udp", GST_RTSP_LOWER_TRANS_UDP},
      {"tcp", GST_RTSP_LOWER_TRANS_TCP}, {"multicast", GST_RTSP_LOWER_TRANS_UDP_MCAST}};
  int transports = GST_RTSP_LOWER_TRANS_TCP;
  if (!options.certificate)
    transports |= GST_RTSP_LOWER_TRANS_UDP;
  if (!options.certificate && options.multicast)
    transports |= GST_RTSP_LOWER_TRANS_UDP_MCAST;
  if (options.transports) {
    transports = 0;
    std::istringstream list (options.transports);
    std::string name;
    do {
      std::getline (list, name, ',');
      if (!known.count (name))
        return fail ("--transports takes a comma-separated list of udp, tcp and multicast, not '" +
                     name + "'");
      transports |= known.at (name);
    } while (!list.eof ());
  }
  if ((transports & GST_RTSP_LOWER_TRANS_UDP_MCAST) && !options.multicast)
    return fail ("--transports multicast needs --multicast ADDRESS:PORT-PORT");
  gst_rtsp_media_factory_set_protocols (factory, GstRTSPLowerTrans (transports));
  /* AVPF for immediate PLI and NACK. With AVP in addition, the SDP has two streams, and players set
   * up both. SRTP where TLS protects its keys but not the packets. */
  gst_rtsp_media_factory_set_profiles (factory,
      options.certificate && transports != GST_RTSP_LOWER_TRANS_TCP ? GST_RTSP_PROFILE_SAVPF
                                                                    : GST_RTSP_PROFILE_AVPF);
  return !options.multicast || set_multicast (factory, options.multicast);
}

GstRTSPMediaFactory *
make_factory (const std::string &launch, const Options &options)
{
  GstRTSPMediaFactory *factory = gst_rtsp_media_factory_new ();
  GST_RTSP_MEDIA_FACTORY_GET_CLASS (factory)->gen_key = run_key; /* of the only factory here */
  gst_rtsp_media_factory_set_media_gtype (factory, launch_media_get_type ());
  gst_rtsp_media_factory_set_launch (factory, launch.c_str ());
  gst_rtsp_media_factory_set_shared (factory, TRUE);
  if (options.retransmission_ms > 0) {
    gst_rtsp_media_factory_set_do_retransmission (factory, TRUE);
    gst_rtsp_media_factory_set_retransmission_time (
        factory, guint64 (options.retransmission_ms) * GST_MSECOND);
  }
  gst_rtsp_media_factory_add_role (factory, kViewerRole, "media.factory.access", G_TYPE_BOOLEAN,
      TRUE, "media.factory.construct", G_TYPE_BOOLEAN, TRUE, nullptr);
  return factory;
}

/* ---- who may watch ---- */

/* One NAME:PASSWORD per line, except for empty lines and those that begin with #. Errors never show
 * the password. */
bool
read_users (GstRTSPAuth *auth, GstRTSPToken *token, const std::string &path)
{
  std::ifstream file (path);
  int n_lines = 0, n_users = 0;
  for (std::string line; std::getline (file, line);) {
    n_lines++;
    while (!line.empty () && g_ascii_isspace (line.back ()))
      line.pop_back ();
    if (line.empty () || line[0] == '#')
      continue;
    const auto colon = line.find (':');
    if (colon == 0 || colon == line.npos || colon + 1 == line.size ())
      return fail (
          path + ":" + std::to_string (n_lines) + ": give NAME:PASSWORD, neither of them empty");
    gst_rtsp_auth_add_digest (
        auth, line.substr (0, colon).c_str (), line.c_str () + colon + 1, token);
    n_users++;
  }
  return n_users > 0 || fail ("--users: cannot read a line NAME:PASSWORD from " + path);
}

bool
set_certificate (GstRTSPAuth *auth, const Options &options)
{
  g_autoptr (GError) error = nullptr;
  const char *key = options.key ? options.key : options.certificate; /* one file with both */
  g_autoptr (GTlsCertificate) certificate =
      g_tls_certificate_new_from_files (options.certificate, key, &error);
  gst_rtsp_auth_set_tls_certificate (auth, certificate);
  return certificate || fail (std::string ("--cert ") + options.certificate + ", --key " + key +
                              ": " + error->message);
}

bool
set_auth (GstRTSPServer *server, const Options &options)
{
  if (options.key && !options.certificate)
    return fail ("--key needs --cert FILE");
  if (!options.users && !options.certificate)
    return true;
  g_autoptr (GstRTSPAuth) auth = gst_rtsp_auth_new ();
  gst_rtsp_auth_set_supported_methods (auth, GST_RTSP_AUTH_DIGEST);
  g_autoptr (GstRTSPToken) token =
      gst_rtsp_token_new (GST_RTSP_TOKEN_MEDIA_FACTORY_ROLE, G_TYPE_STRING, kViewerRole, nullptr);
  if (!options.users)
    gst_rtsp_auth_set_default_token (auth, token);
  gst_rtsp_server_set_auth (server, auth);
  return (!options.users || read_users (auth, token, options.users)) &&
         (!options.certificate || set_certificate (auth, options));
}

/* ---- the command line ---- */

bool
check_range (const char *option, int value, int min, int max)
{
  return (value >= min && value <= max) ||
         fail (std::string (option) + " must be from " + std::to_string (min) + " to " +
               std::to_string (max) + ", not " + std::to_string (value));
}

bool
parse_arguments (int argc, char **argv, Options &options)
{
  const GOptionEntry entries[] = {
      {"address", 0, 0, G_OPTION_ARG_STRING, &options.address,
          "Address or name to listen at (default 0.0.0.0, all of IPv4)", "HOST"},
      {"port", 0, 0, G_OPTION_ARG_INT, &options.port, "TCP port (default 8554; 0: any)", "N"},
      {"mount", 0, 0, G_OPTION_ARG_STRING, &options.mount, "Path of the URL (default /live)",
          "/PATH"},
      {"users", 0, 0, G_OPTION_ARG_FILENAME, &options.users,
          "File of allowed users, one NAME:PASSWORD per line (default: everybody)", "FILE"},
      {"cert", 0, 0, G_OPTION_ARG_FILENAME, &options.certificate,
          "TLS certificate (PEM): serves rtsps://, with frame sets inside the TLS connection",
          "FILE"},
      {"key", 0, 0, G_OPTION_ARG_FILENAME, &options.key,
          "Private key of the certificate (PEM; default: the file of --cert)", "FILE"},
      {"transports", 0, 0, G_OPTION_ARG_STRING, &options.transports,
          "Comma-separated list of udp, tcp, multicast (default: all; with --cert: tcp)", "LIST"},
      {"multicast", 0, 0, G_OPTION_ARG_STRING, &options.multicast,
          "Offer multicast to these addresses and ports, TTL 1 by default",
          "ADDRESS[-ADDRESS]:PORT-PORT[/TTL]"},
      {"retransmission", 0, 0, G_OPTION_ARG_INT, &options.retransmission_ms,
          "Keep packets for this time for retransmission (default 0: none)", "MS"},
      {"max-viewers", 0, 0, G_OPTION_ARG_INT, &options.max_viewers,
          "Maximum number of viewers; more are refused (default 64)", "N"},
      {G_OPTION_REMAINING, 0, 0, G_OPTION_ARG_STRING_ARRAY, &options.launch, nullptr, nullptr}, {}};
  g_autoptr (GOptionContext) context =
      g_option_context_new ("-- LAUNCH STRING - serve coded frame sets over RTSP");
  g_option_context_set_description (
      context, "The launch string ends in coded frame sets or has a payloader named pay0.\n");
  g_option_context_add_main_entries (context, entries, nullptr);
  g_option_context_add_group (context, gst_init_get_option_group ());
  g_autoptr (GError) error = nullptr;
  if (!g_option_context_parse (context, &argc, &argv, &error))
    return fail (error->message);
  if (!check_range ("--port", options.port, 0, 65535) ||
      !check_range ("--retransmission", options.retransmission_ms, 0, 10000) ||
      !check_range ("--max-viewers", options.max_viewers, 1, 100000))
    return false;
  if (!options.address)
    options.address = g_strdup ("0.0.0.0");
  if (!options.mount)
    options.mount = g_strdup ("/live");
  if (options.mount[0] != '/' || options.mount[1] == '\0')
    return fail (
        std::string ("--mount takes a path that begins with /, not '") + options.mount + "'");
  return options.launch || fail ("give a launch string after --; see --help");
}

/* ---- the server ---- */

bool
listen (GstRTSPServer *server, const Options &options)
{
  gst_rtsp_server_set_address (server, options.address);
  gst_rtsp_server_set_service (server, std::to_string (options.port).c_str ());
  g_autoptr (GError) error = nullptr;
  g_autoptr (GSource) source = gst_rtsp_server_create_source (server, nullptr, &error);
  if (!source)
    return fail (std::string ("--address ") + options.address + " --port " +
                 std::to_string (options.port) + ": " + error->message);
  g_source_attach (source, nullptr);
  g_autoptr (GInetAddress) numeric = g_inet_address_new_from_string (options.address);
  const bool is_any = numeric && g_inet_address_get_is_any (numeric);
  g_autofree gchar *url = g_uri_join (G_URI_FLAGS_NONE, options.certificate ? "rtsps" : "rtsp",
      nullptr, is_any ? g_get_host_name () : options.address,
      gst_rtsp_server_get_bound_port (server), options.mount, nullptr, nullptr);
  std::printf ("serving %s\n", url);
  std::fflush (stdout);
  return true;
}

/* Those that were silent for a minute, and those that left, which the library counts as long. */
gboolean
forget_viewers (gpointer pool)
{
  const auto has_left = [] (GstRTSPSessionPool *, GstRTSPSession *session, gpointer) {
    GList *medias = gst_rtsp_session_filter (session, nullptr, nullptr);
    g_list_free_full (medias, g_object_unref);
    return medias ? GST_RTSP_FILTER_KEEP : GST_RTSP_FILTER_REMOVE;
  };
  gst_rtsp_session_pool_cleanup (GST_RTSP_SESSION_POOL (pool));
  gst_rtsp_session_pool_filter (GST_RTSP_SESSION_POOL (pool), has_left, nullptr);
  return G_SOURCE_CONTINUE;
}

/* Returns after reporting an error. Otherwise a signal ends the process. */
void
serve (const Options &options, const std::string &launch)
{
  g_autoptr (GstRTSPServer) server = the_server = gst_rtsp_server_new ();
  g_autoptr (GstRTSPThreadPool) threads = gst_rtsp_server_get_thread_pool (server);
  g_autoptr (GstRTSPSessionPool) sessions = gst_rtsp_server_get_session_pool (server);
  g_autoptr (GstRTSPMountPoints) mounts = gst_rtsp_server_get_mount_points (server);
  g_autoptr (GMainLoop) loop = g_main_loop_new (nullptr, FALSE);
  GstRTSPMediaFactory *factory = make_factory (launch, options);
  gst_rtsp_mount_points_add_factory (mounts, options.mount, factory);
  gst_rtsp_thread_pool_set_max_threads (threads, 0); /* all connections in the main loop */
  gst_rtsp_server_set_content_length_limit (server, kMaxRequestBody);
  gst_rtsp_session_pool_set_max_sessions (sessions, guint (options.max_viewers));
  g_timeout_add_seconds (kCleanupInterval_s, forget_viewers, sessions);
  g_signal_connect (server, "client-connected", G_CALLBACK (on_connected), nullptr);
  if (set_transports (factory, options) && set_auth (server, options) && listen (server, options))
    g_main_loop_run (loop);
}

} // namespace

int
main (int argc, char **argv)
{
  static Options options;   /* never freed */
  setlocale (LC_CTYPE, ""); /* arguments are in the user's encoding */
  if (!parse_arguments (argc, argv, options))
    return 2;
  const std::string launch = complete_launch (options.launch);
  if (!launch.empty ())
    serve (options, launch);
  return 1;
}
