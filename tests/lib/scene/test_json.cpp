/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "../test-support.hpp"

#include <rangecast/scene/json.hpp>

using namespace rangecast;

static bool
parses (const std::string &text)
{
  const std::vector<char> exact (text.begin (), text.end ()); /* so that one byte too far shows */
  Json value;
  return parse_json ({exact.data (), exact.size ()}, value).ok ();
}

TEST (Json, test_members_and_items_are_found_through_all_levels)
{
  Json value;
  ASSERT_TRUE (parse_json (R"( {"a": [1, {"b": -2.5e1}], "c": true, "d": null} )", value).ok ());
  EXPECT_EQ (value["a"][std::size_t{0}].index (), 1);
  EXPECT_EQ (value["a"][1]["b"].number_or (0), -25);
  EXPECT_EQ (value["c"].number, 1);
  EXPECT_TRUE (value["d"].is_null ());
}

TEST (Json, test_what_is_missing_is_null_at_any_depth)
{
  Json value;
  ASSERT_TRUE (parse_json (R"({"a": [1]})", value).ok ());
  EXPECT_TRUE (value["x"]["y"][7]["z"].is_null ());
  EXPECT_EQ (value["a"][9].index (), -1);
  EXPECT_EQ (value["x"].size_or (5), 5u);
}

TEST (Json, test_escapes_become_utf8)
{
  Json value;
  ASSERT_TRUE (parse_json (R"(["\"\\\n\u00e9\u20ac\ud83d\ude00"])", value).ok ());
  EXPECT_EQ (value[std::size_t{0}].text, "\"\\\n\xc3\xa9\xe2\x82\xac\xf0\x9f\x98\x80");
}

TEST (Json, test_index_is_a_whole_number_from_0)
{
  Json value;
  ASSERT_TRUE (parse_json ("[3, -1, 1.5, 1e300, \"3\", 2147483648]", value).ok ());
  EXPECT_EQ (value[std::size_t{0}].index (), 3);
  for (std::size_t i = 1; i < value.size (); i++)
    EXPECT_EQ (value[i].index (), -1) << i;
}

TEST (Json, test_text_that_is_not_json_is_refused)
{
  for (const char *bad :
      {"", "{", "[1,]", "{\"a\" 1}", "{\"a\": }", "[1] 2", "tru", "nan", "inf", "\"\\q\"",
          "\"\\u12\"", "\"\\ud800x\"", "\"open", "{1: 2}", "+1", "-inf", "-nan", "01", "-01", "1.",
          ".5", "-.5", "1e", "1e+", "-", "\"\\udc00\"", "\"\\ud800\"", "\"\\ud800\\ud800\""})
    EXPECT_FALSE (parses (bad)) << bad;
}

TEST (Json, test_every_prefix_is_refused)
{
  const std::string text = R"({"a": [1, "\u20ac", {"b": false}], "c": -1.5e3})";
  ASSERT_TRUE (parses (text));
  for (std::size_t n = 0; n < text.size (); n++)
    EXPECT_FALSE (parses (text.substr (0, n))) << n;
}

TEST (Json, test_numbers_too_small_for_a_double_are_0_and_too_large_ones_do_not_fit)
{
  const auto number = [] (const std::string &text) {
    Json value;
    EXPECT_TRUE (parse_json (text, value).ok ()) << text;
    return value.number_or (-7);
  };
  const std::string zeros (400, '0');
  for (const std::string &small :
      std::vector<std::string>{"1e-400", "-12.5E-400", "0." + zeros + "1", "0." + zeros + "1e30",
          "1" + zeros + "e-800", "1e-99999999999999999999"})
    EXPECT_EQ (number (small), 0) << small;
  for (const std::string &large : std::vector<std::string>{"1e400", "-1.5e+400", "1" + zeros,
           "1" + zeros + "e-30", "0." + zeros + "1e800", "1e99999999999999999999"})
    EXPECT_EQ (number (large), -7) << large;
  EXPECT_EQ (number ("-0.5e-2"), -0.005);
  EXPECT_EQ (number ("0e9999"), 0);
  EXPECT_EQ (number ("10"), 10);
}

TEST (Json, test_more_than_4_million_values_are_refused)
{
  std::string text = "[0";
  for (int i = 2; i < 4'000'000; i++)
    text += ",0";
  EXPECT_TRUE (parses (text + "]"));
  EXPECT_FALSE (parses (text + ",0]"));
}

TEST (Json, test_more_than_64_levels_are_refused)
{
  EXPECT_TRUE (parses (std::string (60, '[') + std::string (60, ']')));
  EXPECT_FALSE (parses (std::string (100000, '[')));
}
