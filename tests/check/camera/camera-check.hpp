/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What the tests with cameras share: a network of their own, and fake GigE Vision cameras in it. */
#pragma once

#include "camera/aravis/camera.hpp"
#include <arv.h>
#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <net/if.h>
#include <netinet/in.h>
#include <sched.h>
#include <string>
#include <sys/ioctl.h>
#include <vector>

#include "../rangecast-check.hpp"

namespace rangecast::testing {

/** Whether the loopback interface answers at 127.0.0.1 to 127.0.0.`n`, each of which can then have
 *  a camera: they all use the same port. */
inline bool
name_loopback_addresses (int n)
{
  const int socket_fd = socket (AF_INET, SOCK_DGRAM, 0);
  bool fine = socket_fd >= 0;
  for (int i = 1; fine && i <= n; i++) {
    struct ifreq request = {};
    g_snprintf (request.ifr_name, sizeof request.ifr_name, i == 1 ? "lo" : "lo:%d", i);
    auto *address = reinterpret_cast<struct sockaddr_in *> (&request.ifr_addr);
    address->sin_family = AF_INET;
    address->sin_addr.s_addr = htonl (0x7f000000 + i);
    fine = i == 1 || ioctl (socket_fd, SIOCSIFADDR, &request) == 0;
    request.ifr_flags = IFF_UP | IFF_LOOPBACK | IFF_RUNNING;
    fine = fine && ioctl (socket_fd, SIOCSIFFLAGS, &request) == 0;
  }
  if (socket_fd >= 0)
    close (socket_fd);
  return fine;
}

/** Leaves the host's network for an empty one with 127.0.0.1 to 127.0.0.8, before any thread is
 *  started: cameras there disturb nobody, and nobody's cameras are found.
 *  @return false where the system does not allow it: a camera test then skips */
inline bool
enter_own_network ()
{
  if (unshare (CLONE_NEWNET) != 0 && unshare (CLONE_NEWUSER | CLONE_NEWNET) != 0)
    return false;
  return name_loopback_addresses (8);
}

inline bool has_own_network = false;

#define SKIP_WITHOUT_NETWORK()                                                                     \
  do {                                                                                             \
    if (!rangecast::testing::has_own_network)                                                      \
      RANGECAST_SKIP ("a network namespace is not allowed here");                                  \
  } while (0)

/** Aravis' fake GigE Vision camera (real GVCP and GVSP over sockets), in this process. */
class FakeCamera {
public:
  /** @param genicam  file with its features; empty: Aravis' own */
  explicit FakeCamera (const std::string &address = "127.0.0.1", const char *serial = "GV01",
      const std::string &genicam = "")
      : camera_ (arv_gv_fake_camera_new_full (
            address.c_str (), serial, genicam.empty () ? nullptr : genicam.c_str ())),
        address_ (address)
  {
    fail_unless (arv_gv_fake_camera_is_running (camera_), "no fake camera at %s", address.c_str ());
  }
  FakeCamera (const FakeCamera &) = delete;
  FakeCamera &operator= (const FakeCamera &) = delete;
  ~FakeCamera () { unplug (); }

  /** It is gone at once, and says nothing. */
  void unplug () { g_clear_object (&camera_); }
  /** @param share  of its picture packets, 0 to 1; resending is not what it can */
  void lose_packets (double share) { g_object_set (camera_, "gvsp-lost-ratio", share, nullptr); }
  [[nodiscard]] ArvFakeCamera *registers () const
  {
    return arv_gv_fake_camera_get_fake_camera (camera_);
  }
  [[nodiscard]] const std::string &address () const { return address_; }

private:
  ArvGvFakeCamera *camera_;
  std::string address_;
};

/** Keeps what a camera's callbacks say, which may come until the camera was stopped. */
class Listener {
public:
  Camera::Arrived arrived () const
  {
    return [heard = heard_] (CameraFrame frame) {
      std::lock_guard guard (heard->lock);
      heard->frames.push_back (std::move (frame));
      heard->changed.notify_all ();
    };
  }
  Camera::Lost lost () const
  {
    return [heard = heard_] (CameraStatus status) {
      std::lock_guard guard (heard->lock);
      heard->losses.push_back (std::move (status));
      heard->changed.notify_all ();
    };
  }
  /** The next frame; fails the test if none comes. */
  CameraFrame next ()
  {
    std::unique_lock guard (heard_->lock);
    const auto some = [this] { return !heard_->frames.empty (); };
    fail_unless (heard_->changed.wait_for (guard, std::chrono::seconds (20), some), "no frame");
    CameraFrame frame = std::move (heard_->frames.front ());
    heard_->frames.pop_front ();
    return frame;
  }
  CameraFrame next_complete ()
  {
    for (;;) {
      CameraFrame frame = next ();
      if (frame.buffer)
        return frame;
    }
  }
  CameraStatus wait_for_loss ()
  {
    std::unique_lock guard (heard_->lock);
    const auto some = [this] { return !heard_->losses.empty (); };
    fail_unless (heard_->changed.wait_for (guard, std::chrono::seconds (60), some), "no loss");
    return heard_->losses.front ();
  }
  std::size_t n_losses ()
  {
    std::lock_guard guard (heard_->lock);
    return heard_->losses.size ();
  }

private:
  struct Heard {
    std::mutex lock;
    std::condition_variable changed;
    std::deque<CameraFrame> frames;
    std::vector<CameraStatus> losses;
  };
  std::shared_ptr<Heard> heard_ = std::make_shared<Heard> ();
};

inline std::unique_ptr<Camera>
open_camera (const std::string &name)
{
  std::unique_ptr<Camera> camera;
  const CameraStatus status = Camera::open (name, camera);
  fail_unless (status.ok (), "%s", status.message ().c_str ());
  return camera;
}

inline CameraSettings
small_pictures (double frame_rate = 100)
{
  CameraSettings settings;
  settings.width = 64;
  settings.height = 48;
  settings.pixel_format = "Mono8";
  settings.frame_rate = frame_rate;
  return settings;
}

inline void
configure (Camera &camera, const CameraSettings &settings)
{
  const CameraStatus status = camera.configure (settings);
  fail_unless (status.ok (), "%s", status.message ().c_str ());
}

inline void
start (Camera &camera, Listener &listener)
{
  const CameraStatus status = camera.start (listener.arrived (), listener.lost ());
  fail_unless (status.ok (), "%s", status.message ().c_str ());
}

inline void
assert_refused (const CameraStatus &status, CameraFault fault, const char *text)
{
  fail_unless (!status.ok ());
  fail_unless (
      status.fault () == fault, "fault %d: %s", int (status.fault ()), status.message ().c_str ());
  fail_unless (status.message ().find (text) != std::string::npos, "'%s' has no '%s'",
      status.message ().c_str (), text);
}

} // namespace rangecast::testing
