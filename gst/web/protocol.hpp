/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Messages of docs/formats/web-protocol.md, without a transport. */
#pragma once

#include <glib.h>
#include <json-glib/json-glib.h>

#include <memory>
#include <optional>
#include <string>
#include <string_view>

namespace web {

inline constexpr int kProtocolVersion = 1;
inline constexpr const char *kSubprotocol = "rangecast.v1";
/** Maximum size of a client's message, bytes. */
inline constexpr gsize kMaxMessage = 16384;
/** Maximum number of a client's WebSocket frames in a second. */
inline constexpr guint kMaxFrameRate = 200;

/** Reasons for which the server closes a WebSocket. */
enum CloseCode : gushort {
  kCloseGoingAway = 1001,
  kCloseUnsupported = 1003,
  kCloseTooBig = 1009,
  kCloseBadMessage = 4400,
  kCloseUnauthorized = 4401,
  kCloseVersion = 4406,
  kCloseTimeout = 4408,
  kCloseLimit = 4429,
};

struct JsonUnref {
  void operator() (JsonNode *node) const { json_node_unref (node); }
};
/** A JSON object; members are read by its functions. */
class JsonMessage {
public:
  /** @return nothing if the text is not a JSON object */
  static std::optional<JsonMessage> parse (std::string_view text);

  /** @return nothing if there is no such member, or it is not a string */
  [[nodiscard]] std::optional<std::string> text (const char *name) const;
  /** Finite: 1e999 is no number. */
  [[nodiscard]] std::optional<double> number (const char *name) const;
  [[nodiscard]] JsonObject *object () const { return json_node_get_object (root_.get ()); }

private:
  std::unique_ptr<JsonNode, JsonUnref> root_;
};

/** The text as a JSON string, with its quotes. */
std::string json_string (const std::string &text);

/** A client's first message. */
struct Hello {
  int version = 0;
  std::string token;
  bool stream = true, stats = false, audio = false; ///< what it wants
  std::optional<std::string> room;                  ///< of a call, instead
};
/** @param[out] error  what is wrong with the message, if nothing is returned */
std::optional<Hello> parse_hello (const JsonMessage &message, std::string &error);

/** Header of a frame set's message. */
struct MessageHeader {
  static constexpr gsize kSize = 24;
  static constexpr guint32 kUnknownDelay = 0xffffffff;

  bool key = false, discontinuity = false;
  guint32 frame_set = 0, dropped = 0;
  guint32 delay_us = kUnknownDelay;
  guint64 sent_us = 0;

  void write (guint8 *to) const;
};

/** Header of a packet of speech. */
struct AudioHeader {
  static constexpr gsize kSize = 16;

  guint32 number = 0;      ///< in the stream
  guint64 captured_us = 0; ///< on g_get_monotonic_time()

  void write (guint8 *to) const;
};

/** Compares in a time that does not depend on where the two differ. */
bool equal_tokens (std::string_view a, std::string_view b);

/** The name that a token has in a file of lines "name token"; `#` begins a comment.
 *  @param[out] error  why the file cannot be read; else empty
 *  @return nothing if the token is not in the file */
std::optional<std::string> find_token (
    const std::string &path, std::string_view token, std::string &error);

} // namespace web
