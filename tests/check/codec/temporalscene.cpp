/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Frame sets that refer to one another, of a person who moves: what comes out is compared pixel by
 * pixel, over slices, threads, rangemux, and numbers that wrap around. */
#include "../scene-check.hpp"

#include <gst/video/video.h>

#include <utility>

using namespace rangecast;
using namespace rangecast::testing;

static constexpr int kWidth = 320, kHeight = 240;
static const char *const kProfiles[] = {"plain", "packed", "entropy"};
static const std::string kLossless = "depth-bits=16 depth-threshold=0 colour-threshold=0 ";
static const std::string kBySlices = "! capsfilter caps=video/x-neighbour-code,alignment=slice ";

/* What a chain of elements makes of some buffers. */
struct Made {
  GstCaps *caps = nullptr;
  std::vector<GstBuffer *> buffers;

  Made (const std::string &launch, GstCaps *input_caps, const std::vector<GstBuffer *> &input)
  {
    GstHarness *h = gst_harness_new_parse (launch.c_str ());
    if (launch.starts_with ("neighbourcodeenc"))
      gst_harness_set_sink_caps_str (h, kAccessUnitsOrSlices);
    gst_harness_set_src_caps (h, gst_caps_ref (input_caps));
    for (GstBuffer *buffer : input)
      fail_unless_equals_int (gst_harness_push (h, gst_buffer_ref (buffer)), GST_FLOW_OK);
    gst_harness_push_event (h, gst_event_new_eos ());
    buffers = pull_all (h);
    caps = gst_pad_get_current_caps (h->sinkpad);
    gst_harness_teardown (h);
  }
  ~Made ()
  {
    unref_all (buffers);
    gst_clear_caps (&caps);
  }
  Made (Made &&other) noexcept
      : caps (std::exchange (other.caps, nullptr)), buffers (std::exchange (other.buffers, {}))
  {
  }
  Made &operator= (const Made &) = delete;

  [[nodiscard]] gsize bytes () const
  {
    gsize sum = 0;
    for (GstBuffer *buffer : buffers)
      sum += gst_buffer_get_size (buffer);
    return sum;
  }
};

static std::string
encoder (const char *profile, const std::string &properties = "")
{
  return std::string ("neighbourcodeenc temporal=true profile=") + profile + " " + properties;
}

static Made
encoded (const Scene &scene, const std::string &launch)
{
  return Made (launch, scene.caps, scene.frame_sets);
}

static std::vector<Pixels>
decoded (const Made &coded, const char *properties = "")
{
  const Made made (std::string ("neighbourcodedec ") + properties, coded.caps, coded.buffers);
  std::vector<Pixels> pixels;
  for (GstBuffer *buffer : made.buffers)
    pixels.push_back (pixels_of (buffer, kWidth, kHeight));
  return pixels;
}

static std::vector<Pixels>
pixels_of (const Scene &scene)
{
  std::vector<Pixels> pixels;
  for (GstBuffer *frame_set : scene.frame_sets)
    pixels.push_back (pixels_of (frame_set, kWidth, kHeight));
  return pixels;
}

static int
distance_of (guint64 a, guint64 b)
{
  return a > b ? int (a - b) : int (b - a);
}

/* How far two sets of frame sets are apart where both are valid; the first number is that of pixels
 * that are valid in one of them only. */
struct Apart {
  int kinds = 0, depth = 0, colour = 0;
};

static Apart
apart (const std::vector<Pixels> &a, const std::vector<Pixels> &b)
{
  Apart most;
  fail_unless_equals_int (int (a.size ()), int (b.size ()));
  for (std::size_t i = 0; i < a.size (); i++)
    for (const auto &[id, plane] : a[i])
      for (std::size_t p = 0; p < plane.size (); p++) {
        const guint64 x = plane[p], y = b[i].at (id)[p];
        most.kinds += !x != !y;
        if (!x || !y)
          continue;
        most.depth = std::max (most.depth, distance_of (x >> 24, y >> 24));
        for (const int shift : {0, 8, 16})
          most.colour = std::max (most.colour, distance_of (x >> shift & 255, y >> shift & 255));
      }
  return most;
}

GST_START_TEST (test_person_who_moves_stays_within_the_thresholds_and_takes_fewer_bytes)
{
  const Scene scene (2, kWidth, kHeight, 10);
  for (const char *profile : kProfiles) {
    const Made coded = encoded (scene, encoder (profile, "colour-threshold=10 "));
    const Made intra =
        encoded (scene, std::string ("neighbourcodeenc colour-threshold=10 profile=") + profile);
    const Apart most = apart (pixels_of (scene), decoded (coded));
    fail_unless_equals_int (most.kinds, 0);
    /* 8 1/2 of 4095 codes between 0.45 and 1.3 m, in 0.1 mm */
    fail_unless (
        most.depth <= 18 && most.colour <= 10, "%s: %d and %d", profile, most.depth, most.colour);
    const double part = double (coded.bytes ()) / double (intra.bytes ());
    fail_unless (part < (profile == std::string ("plain") ? 0.85 : 0.75), "%s: %g", profile, part);
  }
}
GST_END_TEST;

GST_START_TEST (test_person_who_moves_is_lossless_at_thresholds_0)
{
  const Scene scene (2, kWidth, kHeight, 6);
  for (const char *profile : kProfiles)
    fail_unless (decoded (encoded (scene, encoder (profile, kLossless))) == pixels_of (scene), "%s",
        profile);
}
GST_END_TEST;

GST_START_TEST (test_slices_one_by_one_are_the_frame_sets_of_access_units)
{
  const Scene scene (2, kWidth, kHeight, 6);
  for (const char *profile : kProfiles) {
    const Made whole = encoded (scene, encoder (profile));
    const Made slices = encoded (scene, encoder (profile, kBySlices));
    ck_assert_uint_gt (slices.buffers.size (), 10 * whole.buffers.size ());
    fail_unless (decoded (slices) == decoded (whole), "%s", profile);
    for (GstBuffer *slice : slices.buffers) /* of a frame set, not of the slice */
      ck_assert_int_eq (
          GST_BUFFER_FLAG_IS_SET (slice, GST_BUFFER_FLAG_DELTA_UNIT), (GST_BUFFER_PTS (slice) > 0));
  }
}
GST_END_TEST;

GST_START_TEST (test_slices_of_a_lost_one_are_never_wrong_and_whole_again_after_the_refresh_period)
{
  const Scene scene (2, kWidth, kHeight, 14);
  Made slices = encoded (scene, encoder ("packed", "refresh-period=400 " + kBySlices));
  const auto whole = decoded (slices);
  int n = 0;
  std::erase_if (slices.buffers, [&] (GstBuffer *slice) {
    const bool lost = GST_BUFFER_PTS (slice) / Scene::kInterval == 3 && n++ % 5 == 2;
    if (lost)
      gst_buffer_unref (slice);
    return lost;
  });
  const auto lossy = decoded (slices, "request-key-units=false");
  fail_unless_equals_int (int (lossy.size ()), 14);
  for (std::size_t i = 0; i < lossy.size (); i++) {
    const Compared c = compare (whole[i], lossy[i]);
    fail_unless_equals_uint64 (c.wrong, 0);
    if (i == 3 || i == 4)
      fail_unless (c.right < c.valid, "frame set %zu", i);
    if (i < 3 || i >= 3 + 6)
      fail_unless (c.right == c.valid, "frame set %zu", i);
  }
}
GST_END_TEST;

GST_START_TEST (test_views_and_threads_do_not_matter)
{
  const Scene scene (5, kWidth, kHeight, 5);
  for (const char *profile : kProfiles) {
    const Made one = encoded (scene, encoder (profile, "n-threads=1"));
    const Made four = encoded (scene, encoder (profile, "n-threads=4"));
    fail_unless_equals_uint64 (one.bytes (), four.bytes ());
    const auto expected = decoded (one, "n-threads=1");
    fail_unless (decoded (four, "n-threads=4") == expected, "%s", profile);
    fail_unless (decoded (four, "n-threads=64 conceal=last") == expected, "%s", profile);
  }
}
GST_END_TEST;

/* Gives slices other frame numbers: 2^32 - 3 for the first frame set. */
static Made
renumbered (Made coded)
{
  for (std::size_t i = 0; i < coded.buffers.size (); i++) {
    auto units = units_of (bytes_of (coded.buffers[i]));
    for (auto &unit : units)
      GST_WRITE_UINT32_LE (&unit[8], guint32 (i) - 3);
    GstBuffer *buffer = buffer_of (units, GST_BUFFER_PTS (coded.buffers[i]));
    gst_buffer_replace (&coded.buffers[i], buffer);
    gst_buffer_unref (buffer);
  }
  return coded;
}

GST_START_TEST (test_decoder_bears_frame_numbers_that_wrap_around)
{
  const Scene scene (2, kWidth, kHeight, 6);
  for (const char *profile : kProfiles) {
    const auto expected = decoded (encoded (scene, encoder (profile)));
    fail_unless (
        decoded (renumbered (encoded (scene, encoder (profile)))) == expected, "%s", profile);
  }
}
GST_END_TEST;

/* Codes frame sets of these numbers and decodes them. @return of each, whether it refers to another
 * and whether all is there */
static std::string
kinds_of_numbers (const std::vector<guint32> &numbers, Profile profile)
{
  const Rig rig = ring_rig (1, 96, 72);
  EncoderSettings settings;
  settings.profile = profile;
  settings.temporal = true;
  settings.refresh_period_ns = 0;
  AccessUnitEncoder enc;
  AccessUnitDecoder dec;
  fail_unless_ok (enc.configure (rig, settings));
  fail_unless_ok (dec.set_rig (rig));
  std::string kinds;
  guint64 points = 0;
  for (std::size_t i = 0; i < numbers.size (); i++) {
    GstBuffer *in = make_frame_set (rig, i * Scene::kInterval), *out = make_frame_set (rig);
    {
      gstrange::RangeFrameMap from (in, GST_MAP_READ), to (out, GST_MAP_READWRITE);
      EncoderResult coded;
      fail_unless_ok (enc.encode (from.views (), numbers[i], 1, coded));
      DecoderResult result;
      const auto bytes = enc.bytes ();
      dec.plan (bytes, result);
      fail_unless_ok (dec.decode (to.views (), 1, result));
      points = coded.points;
      kinds += coded.delta_slices ? 'd' : 'k';
      kinds += result.points == points && result.unknown_pixels == 0 ? '+' : '-';
    }
    gst_buffer_unref (in);
    gst_buffer_unref (out);
  }
  return kinds;
}

GST_START_TEST (test_encoder_refers_over_255_numbers_and_across_2_to_the_32_but_no_further)
{
  constexpr guint32 kLast = G_MAXUINT32;
  for (const Profile profile : {Profile::kPlain, Profile::kPacked, Profile::kEntropy}) {
    const auto expect = [&] (const std::vector<guint32> &numbers, const char *kinds) {
      fail_unless_cmp (kinds_of_numbers (numbers, profile), ==, kinds);
    };
    expect ({kLast - 1, kLast, 0, 1}, "k+d+d+d+");
    expect ({kLast - 200, 54, 55}, "k+d+d+"); /* 255 further */
    expect ({1000, 1255, 1510}, "k+d+d+");
    expect ({1000, 1256, 1257}, "k+k+d+");
    expect ({kLast - 200, 55, 56}, "k+k+d+"); /* 256 further */
  }
}
GST_END_TEST;

/* Codes the same frame set again and again; a decoder may be given each in any order. */
class Numbered {
public:
  explicit Numbered (const Rig &rig)
  {
    EncoderSettings settings;
    settings.profile = Profile::kPacked;
    settings.temporal = true;
    fail_unless_ok (enc_.configure (rig, settings));
    in_ = make_frame_set (rig);
  }
  Numbered (const Numbered &) = delete;
  ~Numbered () { gst_buffer_unref (in_); }
  std::vector<guint8> code (guint32 number)
  {
    gstrange::RangeFrameMap from (in_, GST_MAP_READ);
    EncoderResult coded;
    fail_unless_ok (enc_.encode (from.views (), number, 1, coded));
    return enc_.bytes ();
  }

private:
  AccessUnitEncoder enc_;
  GstBuffer *in_ = nullptr;
};

GST_START_TEST (test_decoder_keeps_no_reference_that_is_255_numbers_late_and_starts_over_at_256)
{
  const Rig rig = ring_rig (1, 96, 72);
  for (const guint32 late : {1u, 255u, 256u}) {
    Numbered camera (rig), other (rig);
    AccessUnitDecoder dec;
    fail_unless_ok (dec.set_rig (rig));
    const guint32 first = 100; /* the late ones' numbers wrap around */
    GstBuffer *out = make_frame_set (rig);
    DecoderResult result;
    for (const auto &bytes :
        {camera.code (first), other.code (first - late), camera.code (first + 1)}) {
      gstrange::RangeFrameMap to (out, GST_MAP_READWRITE);
      result = {};
      dec.plan (bytes, result);
      fail_unless_ok (dec.decode (to.views (), 1, result));
    }
    fail_unless ((result.unknown_pixels > 0) == (late > 255), "%u late", late);
    gst_buffer_unref (out);
  }
}
GST_END_TEST;

/* The frame sets of each view from an encoder of its own, joined by rangemux. */
static std::vector<GstBuffer *>
join (const std::vector<const Made *> &streams, GstCaps **caps)
{
  GstElement *mux = gst_element_factory_make ("rangemux", nullptr);
  GstHarness *out = gst_harness_new_with_element (mux, nullptr, "src");
  std::vector<GstHarness *> in;
  for (const Made *stream : streams) {
    in.push_back (gst_harness_new_with_element (mux, "sink_%u", nullptr));
    gst_harness_set_src_caps (in.back (), gst_caps_ref (stream->caps));
  }
  gst_object_unref (mux);
  gst_harness_play (out);
  std::vector<GstBuffer *> joined;
  for (std::size_t i = 0; i < streams[0]->buffers.size (); i++) {
    for (std::size_t view = 0; view < streams.size (); view++)
      gst_harness_push (in[view], gst_buffer_ref (streams[view]->buffers[i]));
    joined.push_back (gst_harness_pull (out));
  }
  *caps = gst_pad_get_current_caps (out->sinkpad);
  for (GstHarness *h : in)
    gst_harness_teardown (h);
  gst_harness_teardown (out);
  return joined;
}

GST_START_TEST (test_encoder_of_each_view_and_rangemux_give_what_one_encoder_of_all_gives)
{
  const Scene both (2, kWidth, kHeight, 6);
  const Scene first (2, kWidth, kHeight, 6, "view-id=0"),
      second (2, kWidth, kHeight, 6, "view-id=1");
  for (const char *profile : kProfiles) {
    const Made a = encoded (first, encoder (profile)), b = encoded (second, encoder (profile));
    GstCaps *caps;
    auto joined = join ({&a, &b}, &caps);
    for (std::size_t i = 0; i < joined.size (); i++)
      ck_assert_int_eq (GST_BUFFER_FLAG_IS_SET (joined[i], GST_BUFFER_FLAG_DELTA_UNIT), (i > 0));
    std::vector<Pixels> pixels;
    const Made shown ("neighbourcodedec", caps, joined);
    for (GstBuffer *buffer : shown.buffers)
      pixels.push_back (pixels_of (buffer, kWidth, kHeight));
    fail_unless (pixels == decoded (encoded (both, encoder (profile))), "%s", profile);
    unref_all (joined);
    gst_caps_unref (caps);
  }
}
GST_END_TEST;

/* ---- a camera that vanishes and returns ---- */

/* Two cameras with an encoder each, rangemux, and a decoder, by hand; beside each encoder a decoder
 * that misses nothing. */
class TwoCameras {
public:
  struct Scenes {
    Scene of[2] = {{2, kWidth, kHeight, 14, "view-id=0"}, {2, kWidth, kHeight, 14, "view-id=1"}};
  };

  TwoCameras (const Scenes &scenes, const char *profile, bool feedback)
      : profile_ (profile), feedback_ (feedback), cameras_{{&scenes.of[0]}, {&scenes.of[1]}}
  {
    GstElement *mux = gst_element_factory_make ("rangemux", nullptr);
    mux_ = gst_harness_new_with_element (mux, nullptr, "src");
    for (Camera &camera : cameras_) {
      start (camera);
      camera.in = gst_harness_new_with_element (mux, "sink_%u", nullptr);
      GstCaps *caps = gst_pad_get_current_caps (camera.encoder->sinkpad);
      camera.witness = gst_harness_new ("neighbourcodedec");
      gst_harness_set_src_caps (camera.witness, gst_caps_ref (caps));
      gst_harness_set_src_caps (camera.in, caps);
    }
    gst_object_unref (mux);
    gst_harness_play (mux_);
    decoder_ = gst_harness_new ("neighbourcodedec");
  }
  TwoCameras (const TwoCameras &) = delete;
  ~TwoCameras ()
  {
    for (Camera &camera : cameras_)
      for (GstHarness *h : {camera.encoder, camera.in, camera.witness})
        gst_harness_teardown (h);
    gst_harness_teardown (mux_);
    gst_harness_teardown (decoder_);
  }

  /* The second camera starts over, as after a loss of power. */
  void restart ()
  {
    gst_harness_teardown (cameras_[1].encoder);
    start (cameras_[1]);
  }

  /* One frame set of both, of which the second does not arrive if it is cut off.
   * @return what is there of the second, beside what its encoder sent */
  Compared frame (std::size_t i, bool cut_off)
  {
    Pixels sent;
    for (Camera &camera : cameras_) {
      GstBuffer *coded =
          gst_harness_push_and_pull (camera.encoder, gst_buffer_ref (camera.scene->frame_sets[i]));
      GstBuffer *seen = gst_harness_push_and_pull (camera.witness, gst_buffer_ref (coded));
      sent = pixels_of (seen, kWidth, kHeight); /* of the last camera */
      gst_buffer_unref (seen);
      if (cut_off && &camera == &cameras_[1]) {
        gst_harness_push_event (
            camera.in, gst_event_new_gap (GST_BUFFER_PTS (coded), Scene::kInterval));
        gst_buffer_unref (coded);
      } else {
        gst_harness_push (camera.in, coded);
      }
    }
    GstBuffer *joined = gst_harness_pull (mux_);
    if (i == 0)
      gst_harness_set_src_caps (decoder_, gst_pad_get_current_caps (mux_->sinkpad));
    GstBuffer *shown = gst_harness_push_and_pull (decoder_, joined);
    Pixels pixels = pixels_of (shown, kWidth, kHeight);
    gst_buffer_unref (shown);
    fail_unless (pixels.erase (0) == 1, "the first camera is always there");
    pass_requests_on ();
    return compare (sent, pixels);
  }

private:
  struct Camera {
    const Scene *scene;
    GstHarness *encoder = nullptr, *in = nullptr, *witness = nullptr;
  };

  void start (Camera &camera)
  {
    camera.encoder = harness_of (encoder (profile_, "refresh-period=400"));
    gst_harness_set_src_caps (camera.encoder, gst_caps_ref (camera.scene->caps));
  }

  void pass_requests_on ()
  {
    const auto pass = [] (GstHarness *from, GstHarness *to, bool is_on) {
      while (GstEvent *event = gst_harness_try_pull_upstream_event (from))
        if (is_on && gst_video_event_is_force_key_unit (event))
          gst_harness_push_upstream_event (to, event);
        else
          gst_event_unref (event);
    };
    pass (decoder_, mux_, feedback_);
    for (Camera &camera : cameras_)
      pass (camera.in, camera.encoder, true);
  }

  const char *profile_;
  bool feedback_;
  Camera cameras_[2];
  GstHarness *mux_ = nullptr, *decoder_ = nullptr;
};

/* In frame sets 3 to 6 the second camera is gone. */
static bool
is_gone (std::size_t i)
{
  return i >= 3 && i < 7;
}

GST_START_TEST (test_camera_that_was_cut_off_is_whole_again_within_the_refresh_period)
{
  const TwoCameras::Scenes scenes;
  for (const char *profile : kProfiles) {
    TwoCameras cameras (scenes, profile, false);
    for (std::size_t i = 0; i < 14; i++) {
      const Compared c = cameras.frame (i, is_gone (i));
      fail_unless_equals_uint64 (c.wrong, 0);
      if (is_gone (i)) {
        fail_unless_equals_uint64 (c.right, 0);
      } else if (i == 7) {
        fail_unless (c.right < c.valid, "%s: nothing to wait for", profile);
      } else if (i < 3 || i >= 7 + 6) {
        fail_unless (
            c.right == c.valid, "%s: %g right in frame set %zu", profile, c.right_share (), i);
      }
    }
  }
}
GST_END_TEST;

GST_START_TEST (test_camera_that_was_cut_off_is_whole_in_the_next_frame_set_where_it_can_be_asked)
{
  const TwoCameras::Scenes scenes;
  for (const char *profile : kProfiles) {
    TwoCameras cameras (scenes, profile, true);
    for (std::size_t i = 0; i < 12; i++) {
      const Compared c = cameras.frame (i, is_gone (i));
      fail_unless_equals_uint64 (c.wrong, 0);
      if (i < 3 || i >= 8)
        fail_unless (
            c.right == c.valid, "%s: %g right in frame set %zu", profile, c.right_share (), i);
    }
  }
}
GST_END_TEST;

GST_START_TEST (test_camera_that_started_over_is_whole_at_once)
{
  const TwoCameras::Scenes scenes;
  for (const char *profile : kProfiles) {
    TwoCameras cameras (scenes, profile, false);
    for (std::size_t i = 0; i < 10; i++) {
      if (i == 7)
        cameras.restart ();
      const Compared c = cameras.frame (i, is_gone (i));
      fail_unless_equals_uint64 (c.wrong, 0);
      fail_unless (c.right == (is_gone (i) ? 0 : c.valid), "%s: %g right in frame set %zu", profile,
          c.right_share (), i);
    }
  }
}
GST_END_TEST;

static Suite *
temporalscene_suite (void)
{
  Suite *s = suite_create ("temporalscene");
  TCase *tc = tcase_create ("general");
  tcase_set_timeout (tc, 120);
  suite_add_tcase (s, tc);
  tcase_add_test (tc, test_person_who_moves_stays_within_the_thresholds_and_takes_fewer_bytes);
  tcase_add_test (tc, test_person_who_moves_is_lossless_at_thresholds_0);
  tcase_add_test (tc, test_slices_one_by_one_are_the_frame_sets_of_access_units);
  tcase_add_test (
      tc, test_slices_of_a_lost_one_are_never_wrong_and_whole_again_after_the_refresh_period);
  tcase_add_test (tc, test_views_and_threads_do_not_matter);
  tcase_add_test (tc, test_decoder_bears_frame_numbers_that_wrap_around);
  tcase_add_test (tc, test_encoder_refers_over_255_numbers_and_across_2_to_the_32_but_no_further);
  tcase_add_test (
      tc, test_decoder_keeps_no_reference_that_is_255_numbers_late_and_starts_over_at_256);
  tcase_add_test (tc, test_encoder_of_each_view_and_rangemux_give_what_one_encoder_of_all_gives);
  tcase_add_test (tc, test_camera_that_was_cut_off_is_whole_again_within_the_refresh_period);
  tcase_add_test (
      tc, test_camera_that_was_cut_off_is_whole_in_the_next_frame_set_where_it_can_be_asked);
  tcase_add_test (tc, test_camera_that_started_over_is_whole_at_once);
  return s;
}

GST_CHECK_MAIN (temporalscene);
