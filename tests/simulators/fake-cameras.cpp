/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Stereo cameras round avatartestsrc's person, as GigE Vision cameras on this machine's network:
 * to run programs that need cameras without hardware. */
#include <arpa/inet.h>
#include <glib-unix.h>

#include <algorithm>
#include <clocale>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <mutex>
#include <rangecast/geometry/rig.hpp>
#include <rangecast/rigfile/rig_file.hpp>
#include <rangecast/scene/scene.hpp>
#include <string>
#include <vector>

#include "gige-camera.hpp"
#include "gige-listener.hpp"
#include "scene-pictures.hpp"

namespace {

using rangecast::SceneCamera;
using rangecast::Status;
using rangecast::StatusCode;

/* The command line, checked. */
struct FakeCameraOptions {
  rangecast::SceneSettings scene;
  GigeCameraSettings camera;               ///< the same for all, but address and serial
  std::uint32_t address_base = 0x7f000101; ///< of view0-left; the others follow
  gint third = 0, empty_frames = 25, loop = 0;
  std::string only;            ///< comma-separated names; empty: all
  std::string rig_export, log; ///< files to write; empty: none

  [[nodiscard]] bool serves (const std::string &name) const
  {
    return only.empty () || ("," + only + ",").find ("," + name + ",") != only.npos;
  }
  /** @return false after printing an error */
  bool read (int *argc, char ***argv);

private:
  bool check (
      double loss, const std::string &size, const std::string &colour, const std::string &address);
};

bool
FakeCameraOptions::read (int *argc, char ***argv)
{
  gchar *size = nullptr, *address = nullptr, *colour = nullptr, *rig = nullptr, *model = nullptr,
        *names = nullptr, *log_file = nullptr;
  gint views = 4;
  gdouble fps = 15, loss = 0;
  const GOptionEntry entries[] = {
      {"views", 0, 0, G_OPTION_ARG_INT, &views, "number of stereo cameras (default 4)", "N"},
      {"third", 0, 0, G_OPTION_ARG_NONE, &third, "add a third camera to each", nullptr},
      {"size", 0, 0, G_OPTION_ARG_STRING, &size, "sensor size (default 320x240)", "WxH"},
      {"fps", 0, 0, G_OPTION_ARG_DOUBLE, &fps,
          "initial free-running rate; triggers within half a period show the same moment (default "
          "15)",
          "F"},
      {"colour", 0, 0, G_OPTION_ARG_STRING, &colour,
          "initial pixel format: rgb8 (default), bayer or mono8", "FORMAT"},
      {"address-base", 0, 0, G_OPTION_ARG_STRING, &address,
          "address of view0-left; other cameras have the following ones (default 127.0.1.1)",
          "ADDRESS"},
      {"only", 0, 0, G_OPTION_ARG_STRING, &names,
          "serve only these cameras of the rig, e.g. view0-left,view0-right", "NAMES"},
      {"rig-export", 0, 0, G_OPTION_ARG_FILENAME, &rig, "write the rig file", "FILE"},
      {"log", 0, 0, G_OPTION_ARG_FILENAME, &log_file,
          "write a line for each exposure: camera, frame number, time of day in ns", "FILE"},
      {"model", 0, 0, G_OPTION_ARG_FILENAME, &model,
          "glTF model instead of the built-in figure", "FILE"},
      {"empty-frames", 0, 0, G_OPTION_ARG_INT, &empty_frames,
          "the person appears after N frame periods, and not before N pictures (default 25)", "N"},
      {"loop", 0, 0, G_OPTION_ARG_INT, &loop,
          "draw N moments in advance and repeat them (default 0: draw each)", "N"},
      {"loss", 0, 0, G_OPTION_ARG_DOUBLE, &loss, "lose N of a thousand image packets (default 0)",
          "N"},
      {nullptr, 0, 0, G_OPTION_ARG_NONE, nullptr, nullptr, nullptr},
  };
  GOptionContext *context = g_option_context_new ("- GigE Vision cameras round a moving figure");
  g_option_context_add_main_entries (context, entries, nullptr);
  GError *error = nullptr;
  bool good = g_option_context_parse (context, argc, argv, &error);
  g_option_context_free (context);
  if (!good)
    g_printerr ("fake-cameras: %s\n", error->message);
  g_clear_error (&error);
  const auto take = [] (gchar *text, const char *otherwise = "") {
    std::string copy = text ? text : otherwise;
    g_free (text);
    return copy;
  };
  scene.views = views;
  camera.fps = fps;
  camera.loss = loss / 1000;
  rig_export = take (rig);
  log = take (log_file);
  scene.model = take (model);
  only = take (names);
  const std::string size_text = take (size, "320x240"), colour_text = take (colour, "rgb8"),
                    address_text = take (address, "127.0.1.1");
  if (good && *argc > 1) {
    g_printerr ("fake-cameras: unknown argument '%s'\n", (*argv)[1]);
    good = false;
  }
  return good && check (loss, size_text, colour_text, address_text);
}

bool
FakeCameraOptions::check (
    double loss, const std::string &size, const std::string &colour, const std::string &address)
{
  const auto need = [] (bool good, const char *what) {
    if (!good)
      g_printerr ("fake-cameras: %s\n", what);
    return good;
  };
  char more = 0;
  in_addr base{};
  const bool has_size =
      std::sscanf (size.c_str (), "%5dx%5d%c", &scene.width, &scene.height, &more) == 2;
  camera.width = scene.width;
  camera.height = scene.height;
  camera.pixel_format = colour == "rgb8" ? kRgb8 : colour == "bayer" ? kBayerRg8 : kMono8;
  const bool is_address = inet_pton (AF_INET, address.c_str (), &base) == 1;
  address_base = ntohl (base.s_addr);
  return need (scene.views >= 1 && scene.views <= 64, "--views takes 1 to 64") &&
         need (camera.fps >= 0.1 && camera.fps <= 1000, "--fps takes 0.1 to 1000") &&
         need (loss >= 0 && loss <= 1000, "--loss takes 0 to 1000 packets of a thousand") &&
         need (empty_frames >= 0 && empty_frames <= 1000000, "--empty-frames takes 0 to 1000000") &&
         need (loop >= 0 && loop <= 1000, "--loop takes 0 to 1000 frames") &&
         need (has_size && std::min (scene.width, scene.height) >= 16 &&
                   std::max (scene.width, scene.height) <= 4096,
             "--size takes WIDTHxHEIGHT, 16x16 to 4096x4096") &&
         need (colour == "rgb8" || colour == "bayer" || colour == "mono8",
             "--colour takes rgb8, bayer or mono8") &&
         need (is_address, "--address-base takes an IPv4 address of this machine");
}

/* One stereo camera of the rig. */
struct ViewCameras {
  std::unique_ptr<EmptyPhase> empty;
  std::vector<GigeCamera *> wired; /* fired by the left camera's output line */
};

/* When each picture was taken, to measure how well cameras agree. Any thread. */
class ExposureLog {
public:
  Status open (const std::string &path)
  {
    if (path.empty ())
      return {};
    file_.open (path);
    return file_ ? Status () : Status (StatusCode::kBadValue, "--log: cannot write '" + path + "'");
  }
  /* In time of day: it is the same in all time namespaces. */
  void add (const std::string &serial, std::uint16_t block_id, std::int64_t monotonic_ns)
  {
    if (!file_.is_open ())
      return;
    const std::int64_t ago_ns = g_get_monotonic_time () * 1000 - monotonic_ns,
                       time_ns = g_get_real_time () * 1000 - ago_ns;
    std::lock_guard guard (lock_);
    file_ << serial << ' ' << block_id << ' ' << time_ns << std::endl;
  }

private:
  std::mutex lock_;
  std::ofstream file_;
};

class FakeRig {
public:
  Status create (const FakeCameraOptions &options);
  void print () const;
  ~FakeRig () { listener_.reset (); /* it speaks of the cameras */ }

private:
  Status add_camera (const FakeCameraOptions &options, int view, SceneCamera camera);
  Status export_rig (const FakeCameraOptions &options) const;
  GigeCamera::Scenery scenery_for (int view, SceneCamera camera, std::shared_ptr<ScenePictures> of);

  std::shared_ptr<rangecast::Scene> scene_;
  std::unique_ptr<Moments> moments_;
  ExposureLog log_;
  std::vector<ViewCameras> views_;
  std::vector<std::unique_ptr<GigeCamera>> cameras_;
  std::unique_ptr<GigeListener> listener_;
};

const char *
side_name (SceneCamera camera)
{
  return camera == SceneCamera::kLeft ? "left" : camera == SceneCamera::kRight ? "right" : "third";
}

std::string
serial_of (int view, SceneCamera camera)
{
  return "view" + std::to_string (view) + "-" + side_name (camera);
}

/* The address of the rig's nth camera, whether or not it is served here. */
std::string
address_of (const FakeCameraOptions &options, int view, SceneCamera camera)
{
  const int per_view = options.third ? 3 : 2;
  in_addr address{htonl (options.address_base + std::uint32_t (view * per_view + int (camera)))};
  char text[INET_ADDRSTRLEN] = "";
  inet_ntop (AF_INET, &address, text, sizeof text);
  return text;
}

GigeCamera::Scenery
FakeRig::scenery_for (int view, SceneCamera camera, std::shared_ptr<ScenePictures> pictures)
{
  ViewCameras &cameras = views_[std::size_t (view)];
  GigeCamera::Scenery scenery;
  scenery.moment = [this] (std::int64_t now_ns) { return moments_->at (now_ns); };
  scenery.acquisition = [&cameras] (bool running) {
    running ? cameras.empty->camera_starts () : cameras.empty->camera_stops ();
  };
  scenery.paint = [&cameras, pictures] (std::int64_t moment_ns, std::uint32_t format,
                      const SensorRegion &region, std::span<std::uint8_t> out) {
    const Status s =
        pictures->paint (moment_ns, cameras.empty->at (moment_ns), format, region, out);
    if (!s.ok ())
      g_printerr ("fake-cameras: %s\n", s.message ().c_str ());
  };
  scenery.exposed = [this, &cameras, camera, serial = serial_of (view, camera)] (
                        std::uint16_t block_id, std::int64_t time_ns) {
    log_.add (serial, block_id, time_ns);
    if (camera == SceneCamera::kLeft)
      for (GigeCamera *other : cameras.wired)
        other->line_rises ();
  };
  return scenery;
}

Status
FakeRig::add_camera (const FakeCameraOptions &options, int view, SceneCamera camera)
{
  GigeCameraSettings settings = options.camera;
  settings.serial = serial_of (view, camera);
  settings.address = address_of (options, view, camera);
  settings.seed = std::uint32_t (view * 3 + int (camera) + 1);
  const auto period_ns = std::int64_t (1e9 / settings.fps);
  auto pictures = std::make_shared<ScenePictures> (scene_, view, camera, period_ns, options.loop);
  const SensorRegion all = {0, 0, settings.width, settings.height};
  if (Status s = pictures->prepare (settings.pixel_format, all); !s.ok ())
    return s;
  std::unique_ptr<GigeCamera> made;
  if (Status s = GigeCamera::create (settings, scenery_for (view, camera, pictures), made);
      !s.ok ())
    return s;
  if (camera != SceneCamera::kLeft)
    views_[std::size_t (view)].wired.push_back (made.get ());
  cameras_.push_back (std::move (made));
  return {};
}

Status
FakeRig::export_rig (const FakeCameraOptions &options) const
{
  if (options.rig_export.empty ())
    return {};
  rangecast::Rig rig = scene_->rig ();
  for (rangecast::View &view : rig.views) {
    view.camera = address_of (options, view.id, SceneCamera::kLeft);
    view.right->camera = address_of (options, view.id, SceneCamera::kRight);
    if (options.third)
      view.third->camera = address_of (options, view.id, SceneCamera::kThird);
    else
      view.third.reset ();
  }
  return rangecast::save_rig (options.rig_export, rig);
}

Status
FakeRig::create (const FakeCameraOptions &options)
{
  std::unique_ptr<rangecast::Scene> scene;
  if (Status s = rangecast::Scene::create (options.scene, scene); !s.ok ())
    return s;
  if (Status s = log_.open (options.log); !s.ok ())
    return s;
  scene_ = std::move (scene);
  const auto period_ns = std::int64_t (1e9 / options.camera.fps);
  moments_ = std::make_unique<Moments> (period_ns);
  views_.resize (std::size_t (options.scene.views));
  for (int view = 0; view < options.scene.views; view++) {
    views_[std::size_t (view)].empty =
        std::make_unique<EmptyPhase> (period_ns, options.empty_frames);
    for (SceneCamera camera : {SceneCamera::kLeft, SceneCamera::kRight, SceneCamera::kThird})
      if ((camera != SceneCamera::kThird || options.third) &&
          options.serves (serial_of (view, camera)))
        if (Status s = add_camera (options, view, camera); !s.ok ())
          return s;
  }
  if (cameras_.empty ())
    return {StatusCode::kBadValue,
        "--only: expected names such as view0-left, got '" + options.only + "'"};
  if (Status s = export_rig (options); !s.ok ())
    return s;
  for (const auto &camera : cameras_)
    camera->start ();
  listener_ = std::make_unique<GigeListener> (cameras_);
  listener_->start ();
  return {};
}

void
FakeRig::print () const
{
  for (const auto &camera : cameras_)
    g_print ("%s %s\n", camera->settings ().serial.c_str (), camera->settings ().address.c_str ());
  g_print ("ready\n");
}

gboolean
quit (gpointer loop)
{
  g_main_loop_quit (static_cast<GMainLoop *> (loop));
  return G_SOURCE_CONTINUE;
}

} // namespace

int
main (int argc, char **argv)
{
  setlocale (LC_CTYPE, ""); /* arguments are in the user's encoding */
  FakeCameraOptions options;
  if (!options.read (&argc, &argv))
    return 2;
  FakeRig rig;
  if (Status s = rig.create (options); !s.ok ()) {
    g_printerr ("fake-cameras: %s\n", s.message ().c_str ());
    return EXIT_FAILURE;
  }
  rig.print ();
  std::fflush (stdout);
  GMainLoop *loop = g_main_loop_new (nullptr, FALSE);
  g_unix_signal_add (SIGINT, quit, loop);
  g_unix_signal_add (SIGTERM, quit, loop);
  g_main_loop_run (loop);
  g_main_loop_unref (loop);
  return EXIT_SUCCESS;
}
