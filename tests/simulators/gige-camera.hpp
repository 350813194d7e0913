/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <arv.h>
#include <netinet/in.h>

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <random>
#include <rangecast/base/status.hpp>
#include <string>
#include <thread>
#include <vector>

#include "gige-packets.hpp"
#include "scene-pictures.hpp"

struct GigeCameraSettings {
  std::string address; ///< IPv4, one of this machine's (all of 127.x.y.z are)
  std::string serial;  ///< at most 15 bytes
  int width = 0, height = 0;
  std::uint32_t pixel_format = kRgb8; ///< at first
  double fps = 15;                    ///< at first
  double loss = 0;                    ///< share of the stream's packets that get lost
  bool resend = true;                 ///< whether the camera sends lost packets again
  double link_mbits = 1000;           ///< how fast pictures leave the camera
  std::uint32_t seed = 1;             ///< which packets get lost
};

/** A GigE Vision camera on real sockets. Registers and GenICam description are those of Aravis'
 *  fake camera, with a few features more. A thread of its own answers and sends; one program
 *  controls it.
 */
class GigeCamera {
public:
  /** What the camera sees. The camera's thread. */
  struct Scenery {
    std::function<std::int64_t (std::int64_t now_ns)> moment;
    /** @param moment_ns  CLOCK_MONOTONIC */
    std::function<void (std::int64_t moment_ns, std::uint32_t format, const SensorRegion &region,
        std::span<std::uint8_t> out)>
        paint;
    std::function<void (bool running)> acquisition;
    /** A picture has begun: the signal on the camera's output line.
     *  @param time_ns  CLOCK_MONOTONIC */
    std::function<void (std::uint16_t block_id, std::int64_t time_ns)> exposed;
  };

  /** Opens the sockets. @return kBadValue naming the address */
  static rangecast::Status create (
      const GigeCameraSettings &settings, Scenery scenery, std::unique_ptr<GigeCamera> &camera);
  ~GigeCamera ();
  GigeCamera (const GigeCamera &) = delete;
  GigeCamera &operator= (const GigeCamera &) = delete;

  void start ();

  /* Any thread. */

  /** Answers a discovery command that came by broadcast. */
  void answer_discovery (const GvcpCommand &command, const sockaddr_in &from);
  /** An action command that came by broadcast. */
  void handle_action (const GvcpCommand &command, const sockaddr_in &from);
  /** The signal on the input line. */
  void line_rises ();
  /** As the camera's own regulators do: sets a register, whoever has control. Soon after. */
  void regulate (std::uint32_t address, std::uint32_t value);
  /** The stamp of the next picture, and of that one only, is wrong by so much. */
  void mistake_stamp (std::int64_t by_ns) { stamp_off_ns_ = by_ns; }

  [[nodiscard]] const GigeCameraSettings &settings () const { return settings_; }
  [[nodiscard]] std::uint64_t pictures () const { return pictures_; }

private:
  GigeCamera (const GigeCameraSettings &settings, Scenery scenery);
  rangecast::Status open_sockets ();
  void fill_registers ();

  void run ();
  [[nodiscard]] std::int64_t next_wake (std::int64_t now_ns);
  void receive ();
  void drain_wake_ups (std::int64_t now_ns);
  void check_heartbeat (std::int64_t now_ns);

  void handle (const GvcpCommand &command, const sockaddr_in &from);
  void read_registers (const GvcpCommand &command, const sockaddr_in &from);
  void write_registers (const GvcpCommand &command, const sockaddr_in &from);
  void read_memory (const GvcpCommand &command, const sockaddr_in &from);
  void write_memory (const GvcpCommand &command, const sockaddr_in &from);
  void answer (const sockaddr_in &to, PacketWriter ack) const;
  void refuse (const GvcpCommand &command, const sockaddr_in &to, GvcpStatus status) const;

  [[nodiscard]] bool may_write (const sockaddr_in &from) const;
  void wrote (std::uint32_t address, std::uint32_t value, const sockaddr_in &from);
  void set_acquisition (bool running);
  [[nodiscard]] std::uint32_t get (std::uint32_t address) const;
  void set (std::uint32_t address, std::uint32_t value);

  [[nodiscard]] bool is_triggered_by (std::uint32_t source) const;
  [[nodiscard]] std::int64_t frame_period_ns () const;
  [[nodiscard]] std::uint64_t camera_time (std::int64_t now_ns) const;
  void expose (std::int64_t now_ns);

  struct Frame;
  void send_frame (const Frame &frame, std::uint32_t first, std::uint32_t last);
  void send_again (const GvcpCommand &command);
  void send_test_packet (std::uint32_t packet_size);
  [[nodiscard]] sockaddr_in stream_address () const;
  bool gets_lost ();
  void pace (std::size_t bytes);

  GigeCameraSettings settings_;
  Scenery scenery_;
  ArvFakeCamera *registers_ = nullptr;
  std::vector<std::uint8_t> discovery_data_;
  int control_ = -1, stream_ = -1, wake_ = -1;
  std::atomic<bool> ending_{false}, line_{false}, action_{false};
  std::atomic<std::uint64_t> pictures_{0};
  std::thread thread_;

  std::atomic<std::int64_t> stamp_off_ns_{0};

  std::mutex lock_;                                                /* guards the two below */
  std::vector<std::pair<std::uint32_t, std::uint32_t>> regulated_; /* registers and values */
  std::uint32_t device_key_ = 0, group_key_ = 0, group_mask_ = 0;

  /* the camera's thread */
  sockaddr_in controller_{};
  std::int64_t heard_ns_ = 0, next_frame_ns_ = 0, born_ns_ = 0, paced_until_ns_ = 0;
  bool acquiring_ = false;
  std::uint16_t last_block_ = 65000; /* soon past 65535, after which comes 1 */
  std::vector<Frame> frames_;        /* the last ones, to be sent again */
  std::minstd_rand random_;
};
