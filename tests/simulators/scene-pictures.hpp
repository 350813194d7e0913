/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <rangecast/scene/scene.hpp>
#include <span>
#include <vector>

/** GenICam's names (PFNC) for how pixels lie in memory. */
enum GenicamFormat : std::uint32_t {
  kMono8 = 0x01080001,
  kBayerGr8 = 0x01080008,
  kBayerRg8 = 0x01080009,
  kBayerGb8 = 0x0108000a,
  kBayerBg8 = 0x0108000b,
  kRgb8 = 0x02180014,
};

/** @return 0 for one that we cannot paint */
int bytes_per_pixel (std::uint32_t format);

/** Part of the sensor, pixels. */
struct SensorRegion {
  int x = 0, y = 0, width = 0, height = 0;
  bool operator== (const SensorRegion &) const = default;
};

/** When the pictures of one tick are taken: cameras that are fired one after the other within half
 *  a frame period see the same moment. Any thread. */
class Moments {
public:
  explicit Moments (std::int64_t period_ns) : period_ns_ (period_ns) {}
  std::int64_t at (std::int64_t now_ns);

private:
  std::mutex lock_;
  std::int64_t period_ns_, last_ns_ = -1;
};

/** After all cameras of a view stood still, they see the empty scene for a number of frame periods
 *  and, if they run at a lower rate, of pictures. Any thread. */
class EmptyPhase {
public:
  EmptyPhase (std::int64_t period_ns, int frames)
      : length_ns_ (period_ns * frames), frames_ (frames)
  {
  }
  void camera_starts ();
  void camera_stops ();
  /** Once for each picture. @return whether it shows the empty scene */
  bool at (std::int64_t moment_ns);

private:
  std::mutex lock_;
  std::int64_t length_ns_, first_ns_ = -1, last_ns_ = -1; /* moments of the phase */
  std::int64_t end_ns_ = -1;                              /* -1: not known yet */
  std::int64_t frames_, pictures_ = 0;
  int cameras_ = 0;
};

/** What one camera of the scene sees. For one thread. */
class ScenePictures {
public:
  /** @param loop  0, or after how many frames the motion begins again: pictures are then drawn but
   *               once and kept */
  ScenePictures (std::shared_ptr<rangecast::Scene> scene, int view_id,
      rangecast::SceneCamera camera, std::int64_t period_ns, int loop);

  /** Draws what will be needed first, so that the first picture is not late. */
  rangecast::Status prepare (std::uint32_t format, const SensorRegion &region);
  /** @param out  region's pixels without padding; the format is one of GenicamFormat */
  rangecast::Status paint (std::int64_t moment_ns, bool empty, std::uint32_t format,
      const SensorRegion &region, std::span<std::uint8_t> out);

private:
  rangecast::Status draw (double time_s, bool empty, std::uint32_t format,
      const SensorRegion &region, std::span<std::uint8_t> out);

  std::shared_ptr<rangecast::Scene> scene_;
  int view_id_;
  rangecast::SceneCamera camera_;
  std::int64_t period_ns_;
  std::vector<rangecast::Rgbx> sensor_;
  int width_ = 0, height_ = 0;

  std::vector<std::vector<std::uint8_t>> kept_; /* by phase; the last one is the empty scene */
  std::uint32_t kept_format_ = 0;
  SensorRegion kept_region_;
};
