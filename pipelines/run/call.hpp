/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <memory>

/** One end of a call: negotiates for a webrtcbin with that of the other end, which it meets in a
 *  room of a rangewebsink's server (docs/formats/web-protocol.md#calls). Main loop's thread only.
 */
class Call {
public:
  /** @param url  https://HOST:PORT/#token=TOKEN&room=NAME: the page's, with its token, and the room
   *  @param certificate  PEM file with the server's, or nullptr: one that the system trusts
   *  @return nullptr after reporting what is wrong with them */
  static std::unique_ptr<Call> make (const char *url, const char *certificate);
  virtual ~Call () = default;

  /** Negotiates for the webrtcbin named webrtc of a playing pipeline. Once connected, opens the
   *  pipeline's valves; received streams are linked to its elements call-video and call-audio.
   *  Called again with a new pipeline after call-left. Failures are errors of the webrtcbin.
   *  @return false after reporting that there is none */
  virtual bool join (GstElement *pipeline) = 0;
  /** Handles what the negotiation posts on the pipeline's bus.
   *  @return whether that ends: call-left, and another one may come, or call-over */
  virtual bool handle (GstMessage *message) = 0;
};
