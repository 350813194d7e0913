/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Fake cameras whose pictures say when they were taken, and stereocamsrc in front of them. */
#pragma once

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include "simulators/gige-camera.hpp"
#include "simulators/gige-listener.hpp"
#include <array>
#include <cstring>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "../rangecast-check.hpp" /* gst-check's macros upset headers that come after it */

namespace rangecast::testing {

inline constexpr const char *kSides[] = {"left", "right", "third"};

/** Addresses that no other test program has, most likely. */
inline std::string
camera_address (int camera)
{
  const int run = int (getpid ());
  return "127." + std::to_string (100 + run % 100) + "." + std::to_string (run / 100 % 250) + "." +
         std::to_string (camera + 11);
}

/** Names that no other test program's cameras have: those would be found, too. */
inline std::string
camera_serial (int camera)
{
  return "c" + std::to_string (int (getpid ())) + "-" + std::to_string (camera);
}

/** What a picture has in its first bytes. */
struct PictureMark {
  std::int64_t taken_ns = 0; ///< CLOCK_MONOTONIC
  std::int32_t number = 0;   ///< pictures of this camera before it
  std::int32_t camera = 0;
};

/** A register of a camera, as a program reads it that has no control. */
inline std::uint32_t
read_register (int camera, std::uint32_t address)
{
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons (kGvcpPort);
  inet_pton (AF_INET, camera_address (camera).c_str (), &to.sin_addr);
  const std::uint32_t command[] = {htonl (0x42010080), htonl (0x00040001), htonl (address)};
  std::uint32_t answer[3] = {};
  const timeval patience = {2, 0};
  const int fd = socket (AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  setsockopt (fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  sendto (fd, command, sizeof command, 0, reinterpret_cast<sockaddr *> (&to), sizeof to);
  const ssize_t got = recv (fd, answer, sizeof answer, 0);
  close (fd);
  fail_unless_equals_int (int (got), int (sizeof answer));
  fail_unless_equals_int (int (ntohl (answer[0])), 0x0081); /* READREG_ACK, success */
  return ntohl (answer[2]);
}

/** Two or three cameras of 64x48 on sockets of this machine, in this process. Their threads look at
 *  it: a test that fails where tests share one process (CK_FORK=no) jumps out without destructors,
 *  so what they look at is no test's stack, see TestCameras. */
struct CamerasOnSockets {
  GigeCameraSettings settings;
  std::mutex lock; ///< guards the list against the cameras' threads
  std::vector<std::unique_ptr<GigeCamera>> list;
  std::unique_ptr<GigeListener> listener;

  explicit CamerasOnSockets (int count, double loss, bool resend)
  {
    settings.width = 64;
    settings.height = 48;
    settings.fps = 50;
    settings.pixel_format = kMono8;
    settings.loss = loss;
    settings.resend = resend;
    list.resize (count);
    for (int i = 0; i < count; i++)
      plug (i);
    listener = std::make_unique<GigeListener> (list);
    ck_assert_uint_gt (listener->start (), 0);
  }
  ~CamerasOnSockets ()
  {
    listener.reset ();
    list.clear ();
  }

  void resize (int count)
  {
    std::lock_guard guard (lock);
    list.resize (count);
  }
  void plug (int i)
  {
    settings.address = camera_address (i);
    settings.serial = camera_serial (i);
    settings.seed = static_cast<std::uint32_t> (i + 1);
    GigeCamera::Scenery scenery;
    scenery.moment = [] (std::int64_t now_ns) { return now_ns; };
    scenery.paint = [i, n = 0] (std::int64_t moment_ns, std::uint32_t, const SensorRegion &,
                        std::span<std::uint8_t> out) mutable {
      const PictureMark mark{moment_ns, n++, i};
      std::memset (out.data (), i + 1, out.size ());
      std::memcpy (out.data (), &mark, sizeof mark);
    };
    scenery.acquisition = [] (bool) {};
    scenery.exposed = [this, i] (std::uint16_t, std::int64_t) {
      std::lock_guard guard (lock);
      for (std::size_t other = 1; i == 0 && other < list.size (); other++)
        if (list[other])
          list[other]->line_rises ();
    };
    std::unique_ptr<GigeCamera> camera;
    const Status s = GigeCamera::create (settings, std::move (scenery), camera);
    fail_unless (s.ok (), "%s", s.message ().c_str ());
    camera->start ();
    std::lock_guard guard (lock);
    list[i] = std::move (camera);
  }
  /** As if its cable were pulled out. The listener must not run: give it up first. */
  void unplug (int i)
  {
    listener.reset ();
    std::unique_ptr<GigeCamera> gone;
    {
      std::lock_guard guard (lock);
      gone = std::move (list[i]);
    }
  }
};

/** Those of the test that runs, which go when it ends; those of a test that failed go when the next
 *  one begins, or at exit. */
class TestCameras {
public:
  explicit TestCameras (int count = 2, double loss = 0, bool resend = false)
      : cameras ((of_this_process ().reset (), new CamerasOnSockets (count, loss, resend))),
        list (cameras->list), listener (cameras->listener)
  {
    of_this_process ().reset (cameras);
  }
  ~TestCameras () { of_this_process ().reset (); }
  TestCameras (const TestCameras &) = delete;
  TestCameras &operator= (const TestCameras &) = delete;

  void resize (int count) { cameras->resize (count); }
  void plug (int i) { cameras->plug (i); }
  void unplug (int i) { cameras->unplug (i); }

private:
  static std::unique_ptr<CamerasOnSockets> &of_this_process ()
  {
    static std::unique_ptr<CamerasOnSockets> cameras;
    return cameras;
  }
  CamerasOnSockets *cameras;

public:
  std::vector<std::unique_ptr<GigeCamera>> &list;
  std::unique_ptr<GigeListener> &listener;
};

/** What a pad gave. */
struct SeenPicture {
  GstClockTime pts, capture, duration;
  PictureMark mark;
  bool discont;
};

/** What a streaming thread adds to and a test looks at. */
template <typename T> class SharedList {
public:
  void add (T item)
  {
    std::lock_guard guard (lock_);
    list_.push_back (item);
  }
  [[nodiscard]] std::vector<T> all ()
  {
    std::lock_guard guard (lock_);
    return list_;
  }

private:
  std::mutex lock_;
  std::vector<T> list_;
};

/** A pipeline of stereocamsrc, and a fakesink with a capsfilter before it on each pad. */
class CameraPipeline {
public:
  /** @param properties  as in a launch string, without the cameras' names */
  explicit CameraPipeline (const std::string &properties, int cameras = 2,
      const char *caps = "video/x-raw,format=GRAY8,framerate=50/1", bool named = true)
  {
    std::string launch = "stereocamsrc name=c " + properties;
    for (int i = 0; i < cameras; i++)
      if (named)
        launch += std::string (" ") + kSides[i] + "=" + camera_address (i);
    for (int i = 0; i < cameras; i++)
      launch += std::string (" c.") + kSides[i] + " ! capsfilter caps=\"" + caps +
                "\" ! fakesink sync=false async=false signal-handoffs=true name=" + kSides[i];
    GError *error = nullptr;
    pipeline_ = gst_parse_launch (launch.c_str (), &error);
    fail_unless (error == nullptr, "%s", error ? error->message : "");
    for (int i = 0; i < cameras; i++) {
      GstElement *sink = gst_bin_get_by_name (GST_BIN (pipeline_), kSides[i]);
      g_signal_connect (sink, "handoff", G_CALLBACK (see), this);
      sinks_[i] = sink;
    }
    source_ = gst_bin_get_by_name (GST_BIN (pipeline_), "c");
    bus_ = gst_element_get_bus (pipeline_);
  }
  ~CameraPipeline ()
  {
    gst_element_set_state (pipeline_, GST_STATE_NULL);
    gst_object_unref (bus_);
    for (GstElement *sink : sinks_)
      if (sink)
        gst_object_unref (sink);
    gst_object_unref (source_);
    gst_object_unref (pipeline_);
  }

  void play ()
  {
    ck_assert_int_ne (
        gst_element_set_state (pipeline_, GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE);
  }
  void stop () { gst_element_set_state (pipeline_, GST_STATE_NULL); }

  /** Until EOS; an error fails. */
  void play_to_the_end ()
  {
    play ();
    wait_for_eos ();
  }
  void wait_for_eos ()
  {
    GstMessage *message = gst_bus_timed_pop_filtered (
        bus_, 200 * GST_SECOND, GstMessageType (GST_MESSAGE_EOS | GST_MESSAGE_ERROR));
    fail_unless (message != nullptr, "no EOS came");
    if (GST_MESSAGE_TYPE (message) == GST_MESSAGE_ERROR) {
      GError *error = nullptr;
      gst_message_parse_error (message, &error, nullptr);
      fail ("%s", error->message);
    }
    gst_message_unref (message);
  }
  /** The text of the next error or warning; empty if none came. */
  std::string next_text (GstMessageType type, GstClockTime most = 20 * GST_SECOND)
  {
    GstMessage *message = gst_bus_timed_pop_filtered (bus_, most, type);
    if (!message)
      return "";
    GError *error = nullptr;
    if (type == GST_MESSAGE_ERROR)
      gst_message_parse_error (message, &error, nullptr);
    else
      gst_message_parse_warning (message, &error, nullptr);
    const std::string text = error->message;
    g_error_free (error);
    gst_message_unref (message);
    return text;
  }
  /** Whether such an element message comes. */
  bool says (const char *name)
  {
    while (GstMessage *message =
               gst_bus_timed_pop_filtered (bus_, 20 * GST_SECOND, GST_MESSAGE_ELEMENT)) {
      const bool is = gst_message_has_name (message, name);
      gst_message_unref (message);
      if (is)
        return true;
    }
    return false;
  }
  bool wait_for_pictures (int side, std::size_t count)
  {
    for (int i = 0; i < 2000 && seen (side).size () < count; i++)
      g_usleep (10000);
    const std::size_t came = seen (side).size ();
    if (came < count)
      g_print ("%s: %d pictures came; first error: %s\n", kSides[side], int (came),
          next_text (GST_MESSAGE_ERROR, 0).c_str ());
    return came >= count;
  }

  std::vector<SeenPicture> seen (int side)
  {
    std::lock_guard guard (lock_);
    return seen_[side];
  }
  void forget ()
  {
    std::lock_guard guard (lock_);
    for (auto &list : seen_)
      list.clear ();
  }
  guint64 stat (const char *name) { return stats_field (source_, name); }

  /** The capsfilter of a pad. */
  [[nodiscard]] std::shared_ptr<GstElement> filter (int side) const
  {
    GstPad *pad = gst_element_get_static_pad (source_, kSides[side]),
           *peer = gst_pad_get_peer (pad);
    std::shared_ptr<GstElement> found (gst_pad_get_parent_element (peer), gst_object_unref);
    gst_object_unref (peer);
    gst_object_unref (pad);
    return found;
  }
  [[nodiscard]] GstElement *pipeline () const { return pipeline_; }
  [[nodiscard]] GstElement *source () const { return source_; }
  [[nodiscard]] GstBus *bus () const { return bus_; }

private:
  static void see (GstElement *sink, GstBuffer *buffer, GstPad *, CameraPipeline *self)
  {
    SeenPicture picture{GST_BUFFER_PTS (buffer), gst_range_buffer_get_capture_time (buffer),
        GST_BUFFER_DURATION (buffer), {},
        GST_BUFFER_FLAG_IS_SET (buffer, GST_BUFFER_FLAG_DISCONT) != 0};
    GstMapInfo map;
    fail_unless (gst_buffer_map (buffer, &map, GST_MAP_READ));
    std::memcpy (&picture.mark, map.data, sizeof picture.mark);
    gst_buffer_unmap (buffer, &map);
    std::lock_guard guard (self->lock_);
    for (int i = 0; i < 3; i++)
      if (self->sinks_[i] == sink)
        self->seen_[i].push_back (picture);
  }

  GstElement *pipeline_ = nullptr, *source_ = nullptr;
  std::array<GstElement *, 3> sinks_{};
  GstBus *bus_ = nullptr;
  std::mutex lock_;
  std::array<std::vector<SeenPicture>, 3> seen_;
};

/** PTS of all pads grow, and pictures with one PTS were taken together and say so. A pad that was
 *  held up may lack some that another has; they are counted as its overrun. On a busy machine a
 *  camera may take one late: then the difference of the numbers of both is that of other pairs.
 *  @param apart  ns; how far moments of one pair may lie apart */
inline void
expect_pairs (CameraPipeline &p, int cameras, std::int64_t apart)
{
  const auto left = p.seen (0);
  fail_if (left.empty (), "no picture came");
  for (int side = 1; side < cameras; side++) {
    std::map<GstClockTime, SeenPicture> others;
    for (const SeenPicture &picture : p.seen (side))
      others[picture.pts] = picture;
    std::size_t met = 0;
    std::map<std::int32_t, std::size_t> together; /* by difference of the numbers */
    std::map<GstClockTime, std::int32_t> late;    /* the same, by PTS */
    for (const SeenPicture &picture : left) {
      const auto found = others.find (picture.pts);
      if (found == others.end ())
        continue;
      const SeenPicture &other = found->second;
      met++;
      fail_unless_equals_uint64 (other.capture, picture.capture);
      fail_unless_equals_int (other.mark.camera, side);
      const std::int32_t numbers = other.mark.number - picture.mark.number;
      if (std::llabs (other.mark.taken_ns - picture.mark.taken_ns) < slowdown () * apart)
        together[numbers]++;
      else
        late[picture.pts] = numbers;
    }
    fail_unless (10 * late.size () <= met, "%d of %d pictures of %s were not taken with left's",
        int (late.size ()), int (met), kSides[side]);
    for (const auto &[pts, numbers] : late)
      fail_unless (together[numbers] > 0,
          "PTS %" GST_TIME_FORMAT ": %s has a number %d greater than left's, and no other pair has",
          GST_TIME_ARGS (pts), kSides[side], numbers);
    const guint64 lacking = p.stat ((std::string ("overrun-") + kSides[side]).c_str ());
    fail_unless (met + lacking >= left.size (), "%d of %d left pictures have a partner", int (met),
        int (left.size ()));
  }
  for (std::size_t i = 1; i < left.size (); i++)
    fail_unless (left[i].pts > left[i - 1].pts, "PTS does not grow at %d", int (i));
}

} // namespace rangecast::testing
