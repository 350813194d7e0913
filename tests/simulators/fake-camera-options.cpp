/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "fake-camera-options.hpp"

#include <arpa/inet.h>
#include <glib.h>

#include <cstdio>
#include <cstdlib>

namespace {

constexpr int kWrongUsage = 2;

} // namespace

bool
FakeCameraOptions::serves (const std::string &name) const
{
  return only.empty () || ("," + only + ",").find ("," + name + ",") != only.npos;
}

namespace {

/* Values of the command line, unchecked. */
struct RawOptions {
  gint views = 4, third = 0, empty_frames = 25, loop = 0, no_resend = 0;
  gdouble fps = 15, loss = 0, link = 1000;
  gchar *size = nullptr, *address = nullptr, *colour = nullptr, *rig = nullptr, *model = nullptr,
        *only = nullptr, *log = nullptr;

  ~RawOptions ()
  {
    for (gchar *text : {size, address, colour, rig, model, only, log})
      g_free (text);
  }
};

bool
bad (const char *option, const char *expected, const std::string &got)
{
  g_printerr ("fake-cameras: %s: expected %s, got '%s'\n", option, expected, got.c_str ());
  return false;
}

bool
parse (int *argc, char ***argv, RawOptions &raw)
{
  const GOptionEntry entries[] = {
      {"views", 0, 0, G_OPTION_ARG_INT, &raw.views, "number of stereo cameras (default 4)", "N"},
      {"third", 0, 0, G_OPTION_ARG_NONE, &raw.third, "add a third camera to each", nullptr},
      {"size", 0, 0, G_OPTION_ARG_STRING, &raw.size, "sensor size (default 320x240)", "WxH"},
      {"fps", 0, 0, G_OPTION_ARG_DOUBLE, &raw.fps,
          "initial free-running rate; triggers within half a period show the same moment (default "
          "15)",
          "F"},
      {"colour", 0, 0, G_OPTION_ARG_STRING, &raw.colour,
          "initial pixel format: rgb8 (default), bayer or mono8", "FORMAT"},
      {"address-base", 0, 0, G_OPTION_ARG_STRING, &raw.address,
          "address of view0-left; other cameras have the following ones (default 127.0.1.1)",
          "ADDRESS"},
      {"only", 0, 0, G_OPTION_ARG_STRING, &raw.only,
          "serve only these cameras of the rig, e.g. view0-left,view0-right", "NAMES"},
      {"rig-export", 0, 0, G_OPTION_ARG_FILENAME, &raw.rig, "write the rig file", "FILE"},
      {"log", 0, 0, G_OPTION_ARG_FILENAME, &raw.log,
          "write a line for each exposure: camera, frame number, time of day in ns", "FILE"},
      {"model", 0, 0, G_OPTION_ARG_FILENAME, &raw.model,
          "glTF or OBJ model instead of the built-in figure", "FILE"},
      {"empty-frames", 0, 0, G_OPTION_ARG_INT, &raw.empty_frames,
          "the person appears after N frame periods, and not before N pictures (default 25)", "N"},
      {"loop", 0, 0, G_OPTION_ARG_INT, &raw.loop,
          "draw N moments in advance and repeat them (default 0: draw each)", "N"},
      {"loss", 0, 0, G_OPTION_ARG_DOUBLE, &raw.loss,
          "lose N of a thousand image packets (default 0)", "N"},
      {"no-resend", 0, 0, G_OPTION_ARG_NONE, &raw.no_resend, "do not resend lost packets", nullptr},
      {"link", 0, 0, G_OPTION_ARG_DOUBLE, &raw.link, "link speed of each camera (default 1000)",
          "MBIT/S"},
      {nullptr, 0, 0, G_OPTION_ARG_NONE, nullptr, nullptr, nullptr},
  };
  GOptionContext *context = g_option_context_new ("- GigE Vision cameras round a moving figure");
  g_option_context_add_main_entries (context, entries, nullptr);
  GError *error = nullptr;
  const bool good = g_option_context_parse (context, argc, argv, &error);
  g_option_context_free (context);
  if (!good)
    g_printerr ("fake-cameras: %s\n", error->message);
  g_clear_error (&error);
  return good;
}

bool
parse_numbers (const RawOptions &raw, FakeCameraOptions &options)
{
  if (raw.views < 1 || raw.views > 64)
    return bad ("--views", "1 to 64", std::to_string (raw.views));
  if (!(raw.fps >= 0.1 && raw.fps <= 1000))
    return bad ("--fps", "0.1 to 1000", std::to_string (raw.fps));
  if (!(raw.loss >= 0 && raw.loss <= 1000))
    return bad ("--loss", "0 to 1000 packets of a thousand", std::to_string (raw.loss));
  if (!(raw.link >= 1 && raw.link <= 1e6))
    return bad ("--link", "1 to 1000000 Mbit/s", std::to_string (raw.link));
  if (raw.empty_frames < 0 || raw.empty_frames > 1000000)
    return bad ("--empty-frames", "0 to 1000000", std::to_string (raw.empty_frames));
  if (raw.loop < 0 || raw.loop > 1000)
    return bad ("--loop", "0 to 1000 frames", std::to_string (raw.loop));
  options.scene.views = raw.views;
  options.camera.fps = raw.fps;
  options.camera.loss = raw.loss / 1000;
  options.camera.link_mbits = raw.link;
  options.camera.resend = !raw.no_resend;
  options.third = raw.third;
  options.empty_frames = raw.empty_frames;
  options.loop = raw.loop;
  return true;
}

bool
parse_texts (const RawOptions &raw, FakeCameraOptions &options)
{
  char more = 0;
  if (raw.size && (std::sscanf (raw.size, "%5dx%5d%c", &options.scene.width, &options.scene.height,
                       &more) != 2 ||
                      options.scene.width < 16 || options.scene.height < 16 ||
                      options.scene.width > 4096 || options.scene.height > 4096))
    return bad ("--size", "WIDTHxHEIGHT, 16x16 to 4096x4096", raw.size);
  options.camera.width = options.scene.width;
  options.camera.height = options.scene.height;
  const std::string colour = raw.colour ? raw.colour : "rgb8";
  if (colour != "rgb8" && colour != "bayer" && colour != "mono8")
    return bad ("--colour", "rgb8, bayer or mono8", colour);
  options.camera.pixel_format = colour == "rgb8" ? kRgb8 : colour == "bayer" ? kBayerRg8 : kMono8;
  in_addr address{};
  if (raw.address && inet_pton (AF_INET, raw.address, &address) != 1)
    return bad ("--address-base", "an IPv4 address of this machine, e.g. 127.0.1.1", raw.address);
  if (raw.address)
    options.address_base = ntohl (address.s_addr);
  options.rig_export = raw.rig ? raw.rig : "";
  options.log = raw.log ? raw.log : "";
  options.scene.model = raw.model ? raw.model : "";
  options.only = raw.only ? raw.only : "";
  return true;
}

} // namespace

int
read_fake_camera_options (int argc, char **argv, FakeCameraOptions &options)
{
  RawOptions raw;
  if (!parse (&argc, &argv, raw))
    return kWrongUsage;
  if (argc > 1) {
    g_printerr ("fake-cameras: unknown argument '%s'\n", argv[1]);
    return kWrongUsage;
  }
  return parse_numbers (raw, options) && parse_texts (raw, options) ? -1 : kWrongUsage;
}
