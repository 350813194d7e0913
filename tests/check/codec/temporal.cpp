/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Frame sets that refer to one another: neighbourcodeenc temporal=true, neighbourcodedec, and what
 * lies between them. */
#include "../scene-check.hpp"

#include <gst/video/video.h>

#include <utility>

using namespace rangecast;
using namespace rangecast::testing;

static constexpr GstClockTime kFrame = GST_SECOND / 30;
static const char *const kProfiles[] = {"packed", "entropy"};

static GstHarness *
encoder (const Rig &rig, const std::string &properties = "profile=entropy")
{
  GstHarness *h = harness_of ("neighbourcodeenc temporal=true " + properties);
  gst_harness_set_src_caps (h, range_caps (rig));
  return h;
}

static GstHarness *
decoder (const Rig &rig, const char *properties = "")
{
  GstHarness *h = harness_of (std::string ("neighbourcodedec ") + properties);
  gst_harness_set_src_caps (h, coded_caps (rig));
  return h;
}

/* Frame set number `i`; all show the same. */
static GstBuffer *
code (GstHarness *h, const Rig &rig, guint i)
{
  return gst_harness_push_and_pull (h, make_frame_set (rig, i * kFrame));
}

static bool
is_delta (GstBuffer *buffer)
{
  return GST_BUFFER_FLAG_IS_SET (buffer, GST_BUFFER_FLAG_DELTA_UNIT);
}

/* Codes frame sets from..to-1. @return whether each refers to an earlier one: 'd', or 'k' if not */
static std::string
kinds (GstHarness *h, const Rig &rig, guint from, guint to)
{
  std::string kinds;
  for (guint i = from; i < to; i++) {
    GstBuffer *coded = code (h, rig, i);
    kinds += is_delta (coded) ? 'd' : 'k';
    for (const auto &unit : slices_of (coded))
      fail_unless (header_of (unit).key || is_delta (coded));
    gst_buffer_unref (coded);
  }
  return kinds;
}

static guint
valid_pixels (GstBuffer *frame_set)
{
  gstrange::RangeFrameMap frame (frame_set, GST_MAP_READ);
  fail_unless_ok (frame.status ());
  guint count = 0;
  for (const RangeImage &image : frame.views ())
    for (int y = 0; y < image.roi.height; y++)
      for (int x = 0; x < image.roi.width; x++)
        count += image.depth.at (x, y) != 0;
  return count;
}

/* Events of GstForceKeyUnit that wait in a queue of the harness. */
static int
count_requests (GstHarness *h, bool upstream)
{
  int count = 0;
  while (GstEvent *event =
             upstream ? gst_harness_try_pull_upstream_event (h) : gst_harness_try_pull_event (h)) {
    count += gst_video_event_is_force_key_unit (event);
    gst_event_unref (event);
  }
  return count;
}

GST_START_TEST (test_only_the_first_frame_set_is_a_key_one_and_a_still_scene_takes_few_bytes)
{
  const Rig rig = ring_rig (2);
  for (const char *profile : kProfiles) {
    GstHarness *h = encoder (rig, std::string ("refresh-period=0 profile=") + profile);
    GstBuffer *first = code (h, rig, 0), *second = code (h, rig, 1);
    fail_unless (!is_delta (first) && is_delta (second));
    /* Motion that smooths what thresholds changed may leave some pixels beyond them. */
    constexpr double part = 0.18;
    const double most = part * double (gst_buffer_get_size (first));
    fail_unless (double (gst_buffer_get_size (second)) < most,
        "%s: %" G_GSIZE_FORMAT " of %" G_GSIZE_FORMAT, profile, gst_buffer_get_size (second),
        gst_buffer_get_size (first));
    gst_buffer_unref (first);
    gst_buffer_unref (second);
    gst_harness_teardown (h);
  }
}
GST_END_TEST;

GST_START_TEST (test_a_request_from_downstream_makes_a_key_frame_set_and_is_announced)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = encoder (rig);
  fail_unless_cmp (kinds (h, rig, 0, 3), ==, "kdd");
  fail_unless_equals_int (count_requests (h, false), 0);
  fail_unless (gst_harness_push_upstream_event (
      h, gst_video_event_new_upstream_force_key_unit (GST_CLOCK_TIME_NONE, TRUE, 7)));
  fail_unless_equals_int (count_requests (h, true), 0); /* it ends here */
  fail_unless_cmp (kinds (h, rig, 3, 6), ==, "kdd");
  fail_unless_equals_int (count_requests (h, false), 1);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_a_request_from_upstream_waits_for_its_running_time)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = encoder (rig);
  fail_unless_cmp (kinds (h, rig, 0, 2), ==, "kd");
  fail_unless (gst_harness_push_event (h, gst_video_event_new_downstream_force_key_unit (
                                              4 * kFrame, 4 * kFrame, 4 * kFrame, FALSE, 1)));
  fail_unless_equals_int (count_requests (h, false), 0);
  fail_unless_cmp (kinds (h, rig, 2, 7), ==, "ddkdd");
  fail_unless_equals_int (count_requests (h, false), 1);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_a_decoder_can_begin_at_every_frame_set_without_the_delta_flag)
{
  const Rig rig = ring_rig (2);
  GstHarness *enc = encoder (rig);
  const Roi whole = {10, 10, 200, 180};
  std::string kinds;
  for (guint i = 0; i < 8; i++) {
    GstBuffer *frame_set = make_frame_set (rig, i * kFrame, whole);
    if (i == 3) { /* nobody is there */
      gst_buffer_unref (frame_set);
      frame_set = gst_range_buffer_new (2, 320, 240);
      for (int id = 0; id < 2; id++)
        gst_range_buffer_add_view (frame_set, id, 0, 0, 0, 0, i * kFrame);
      gst_range_buffer_set_capture_time (frame_set, i * kFrame);
      GST_BUFFER_PTS (frame_set) = i * kFrame;
    }
    GstBuffer *coded = gst_harness_push_and_pull (enc, frame_set);
    kinds += is_delta (coded) ? 'd' : 'k';
    gst_buffer_unref (coded);
  }
  fail_unless_equals_string (kinds.c_str (), "kddkkddd");
  gst_harness_teardown (enc);
}
GST_END_TEST;

GST_START_TEST (test_key_interval_flush_caps_and_changed_bits_start_over)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = encoder (rig, "profile=packed refresh-period=0 key-interval=100");
  fail_unless_cmp (kinds (h, rig, 0, 7), ==, "kddkddk");
  g_object_set (h->element, "key-interval", 0, nullptr);
  flush (h);
  fail_unless_cmp (kinds (h, rig, 7, 10), ==, "kdd");
  g_object_set (h->element, "depth-bits", 10, nullptr);
  fail_unless_cmp (kinds (h, rig, 10, 12), ==, "kd");
  g_object_set (h->element, "colour-threshold", 3, nullptr); /* the references stay good */
  fail_unless_cmp (kinds (h, rig, 12, 14), ==, "dd");
  const Rig other = ring_rig (2);
  gst_harness_set_src_caps (h, range_caps (other));
  fail_unless_cmp (kinds (h, other, 14, 16), ==, "kd");
  g_object_set (h->element, "temporal", FALSE, nullptr);
  fail_unless_cmp (kinds (h, other, 16, 18), ==, "kk");
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_what_refers_to_a_lost_frame_set_is_left_out_and_a_key_one_is_asked_for)
{
  const Rig rig = ring_rig (2);
  for (const char *profile : kProfiles) {
    GstHarness *enc = encoder (rig, std::string ("refresh-period=0 profile=") + profile);
    GstHarness *dec = decoder (rig);
    GstBuffer *whole = gst_harness_push_and_pull (dec, code (enc, rig, 0));
    const guint all = valid_pixels (whole);
    gst_buffer_unref (code (enc, rig, 1)); /* is lost */
    fail_unless_equals_int (count_requests (dec, true), 0);
    GstBuffer *holes = gst_harness_push_and_pull (dec, code (enc, rig, 2));
    fail_unless (valid_pixels (holes) < all / 4, "%s", profile);
    fail_unless_equals_int (count_requests (dec, true), 1);
    gst_buffer_unref (gst_harness_push_and_pull (dec, code (enc, rig, 3)));
    fail_unless_equals_int (count_requests (dec, true), 0); /* not so soon again */
    gst_harness_push_upstream_event (
        enc, gst_video_event_new_upstream_force_key_unit (GST_CLOCK_TIME_NONE, FALSE, 0));
    GstBuffer *again = gst_harness_push_and_pull (dec, code (enc, rig, 4));
    fail_unless_equals_int (valid_pixels (again), all);
    for (GstBuffer *buffer : {whole, holes, again})
      gst_buffer_unref (buffer);
    gst_harness_teardown (enc);
    gst_harness_teardown (dec);
  }
}
GST_END_TEST;

GST_START_TEST (test_frame_sets_that_others_refer_to_are_decoded_also_when_late)
{
  const Rig rig = ring_rig (1);
  GstHarness *enc = encoder (rig), *dec = decoder (rig);
  gst_buffer_unref (gst_harness_push_and_pull (dec, code (enc, rig, 0)));
  gst_harness_push_upstream_event (
      dec, gst_event_new_qos (GST_QOS_TYPE_UNDERFLOW, 0.1, GST_SECOND, 0));
  for (guint i = 1; i < 4; i++) {
    fail_unless_equals_int (gst_harness_push (dec, code (enc, rig, i)), GST_FLOW_OK);
    GstBuffer *shown = gst_harness_try_pull (dec);
    fail_unless (shown != nullptr);
    gst_buffer_unref (shown);
  }
  gst_harness_teardown (enc);
  gst_harness_teardown (dec);
}
GST_END_TEST;

GST_START_TEST (test_rtp_and_the_parser_keep_the_delta_flag)
{
  const Rig rig = ring_rig (2);
  for (const char *between :
      {"rtpneighbourcodepay ! rtpneighbourcodedepay", "neighbourcodeparse"}) {
    GstHarness *h = gst_harness_new_parse (
        (std::string ("neighbourcodeenc temporal=true profile=entropy ! ") + between).c_str ());
    gst_harness_set_src_caps (h, range_caps (rig));
    for (guint i = 0; i < 4; i++)
      gst_harness_push (h, make_frame_set (rig, i * kFrame));
    gst_harness_push_event (h, gst_event_new_eos ());
    auto buffers = pull_all (h);
    fail_unless_equals_int (int (buffers.size ()), 4);
    for (std::size_t i = 0; i < 4; i++)
      fail_unless (is_delta (buffers[i]) == (i > 0), "%s: %zu", between, i);
    unref_all (buffers);
    gst_harness_teardown (h);
  }
}
GST_END_TEST;

/* ---- a person who moves, pixel by pixel ---- */

static constexpr int kWidth = 320, kHeight = 240;

/* What a chain of elements makes of some buffers. */
struct Made {
  GstCaps *caps = nullptr;
  std::vector<GstBuffer *> buffers;

  Made (const std::string &launch, GstCaps *input_caps, const std::vector<GstBuffer *> &input)
  {
    GstHarness *h = gst_harness_new_parse (launch.c_str ());
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
encoder_of (const char *profile, const std::string &properties = "")
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
    const Made coded = encoded (scene, encoder_of (profile, "colour-threshold=10 "));
    const Made intra =
        encoded (scene, std::string ("neighbourcodeenc colour-threshold=10 profile=") + profile);
    const Apart most = apart (pixels_of (scene), decoded (coded));
    fail_unless_equals_int (most.kinds, 0);
    /* 8 1/2 of 4095 codes between 0.45 and 1.3 m, in 0.1 mm */
    fail_unless (
        most.depth <= 18 && most.colour <= 10, "%s: %d and %d", profile, most.depth, most.colour);
    const double part = double (coded.bytes ()) / double (intra.bytes ());
    fail_unless (part < 0.75, "%s: %g", profile, part);
  }
}
GST_END_TEST;

GST_START_TEST (test_views_and_threads_do_not_matter)
{
  const Scene scene (5, kWidth, kHeight, 5);
  for (const char *profile : kProfiles) {
    const Made one = encoded (scene, encoder_of (profile, "n-threads=1"));
    const Made four = encoded (scene, encoder_of (profile, "n-threads=4"));
    fail_unless_equals_uint64 (one.bytes (), four.bytes ());
    const auto expected = decoded (one, "n-threads=1");
    fail_unless (decoded (four, "n-threads=4") == expected, "%s", profile);
    fail_unless (decoded (four, "n-threads=64") == expected, "%s", profile);
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
  for (const Profile profile : {Profile::kPacked, Profile::kEntropy}) {
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
    const Made a = encoded (first, encoder_of (profile)),
               b = encoded (second, encoder_of (profile));
    GstCaps *caps;
    auto joined = join ({&a, &b}, &caps);
    for (std::size_t i = 0; i < joined.size (); i++)
      ck_assert_int_eq (GST_BUFFER_FLAG_IS_SET (joined[i], GST_BUFFER_FLAG_DELTA_UNIT), (i > 0));
    std::vector<Pixels> pixels;
    const Made shown ("neighbourcodedec", caps, joined);
    for (GstBuffer *buffer : shown.buffers)
      pixels.push_back (pixels_of (buffer, kWidth, kHeight));
    fail_unless (pixels == decoded (encoded (both, encoder_of (profile))), "%s", profile);
    unref_all (joined);
    gst_caps_unref (caps);
  }
}
GST_END_TEST;

static Suite *
temporal_suite (void)
{
  Suite *s = suite_create ("temporal");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (s, tc);
  tcase_add_test (tc, test_only_the_first_frame_set_is_a_key_one_and_a_still_scene_takes_few_bytes);
  tcase_add_test (tc, test_a_request_from_downstream_makes_a_key_frame_set_and_is_announced);
  tcase_add_test (tc, test_a_request_from_upstream_waits_for_its_running_time);
  tcase_add_test (tc, test_a_decoder_can_begin_at_every_frame_set_without_the_delta_flag);
  tcase_add_test (tc, test_key_interval_flush_caps_and_changed_bits_start_over);
  tcase_add_test (tc, test_what_refers_to_a_lost_frame_set_is_left_out_and_a_key_one_is_asked_for);
  tcase_add_test (tc, test_frame_sets_that_others_refer_to_are_decoded_also_when_late);
  tcase_add_test (tc, test_rtp_and_the_parser_keep_the_delta_flag);
  tcase_add_test (tc, test_person_who_moves_stays_within_the_thresholds_and_takes_fewer_bytes);
  tcase_add_test (tc, test_views_and_threads_do_not_matter);
  tcase_add_test (tc, test_encoder_refers_over_255_numbers_and_across_2_to_the_32_but_no_further);
  tcase_add_test (tc, test_encoder_of_each_view_and_rangemux_give_what_one_encoder_of_all_gives);
  return s;
}

GST_CHECK_MAIN (temporal);
