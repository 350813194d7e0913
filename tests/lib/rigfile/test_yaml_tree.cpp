/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "test-support.hpp"

#include <fstream>
#include <rangecast/rigfile/yaml_tree.hpp>
#include <unistd.h>

using namespace rangecast;

namespace {

constexpr std::uint64_t kLimit = 4 << 20;

std::string
temporary (const std::string &name)
{
  return ::testing::TempDir () + "rangecast-" + std::to_string (getpid ()) + "-" + name;
}

Status
read_text (const std::string &text, YamlNode &root)
{
  const std::string path = temporary ("tree.yml");
  std::ofstream (path, std::ios::binary) << text;
  const Status status = read_yaml (path, kLimit, root);
  std::filesystem::remove (path);
  EXPECT_TRUE (status.ok () || status.message ().starts_with (path)) << status.message ();
  return status;
}

YamlNode
tree (const std::string &text)
{
  YamlNode root;
  const Status status = read_text (text, root);
  EXPECT_TRUE (status.ok ()) << status.message ();
  return root;
}

void
expect_refused (const std::string &text, const std::string &why)
{
  YamlNode root;
  const Status status = read_text (text, root);
  EXPECT_EQ (status.code (), StatusCode::kBadData) << text.substr (0, 60);
  EXPECT_NE (status.message ().find (why), std::string::npos) << status.message ();
}

std::string
repeated (const std::string &text, int count)
{
  std::string all;
  for (int i = 0; i < count; i++)
    all += text;
  return all;
}

const std::string kHead = "%YAML:1.0\n---\n";

} // namespace

TEST (YamlTree, yaml_has_numbers_texts_lists_and_maps)
{
  const YamlNode root = tree (kHead + "i: 7\nr: [ 1., .5, -2.5e+01, +3 ]\nt: \"007\"\nm:\n   - \n"
                                      "      a: 'b''c'\n   - plain text # why\ns: !!str 12\nn:\n");
  EXPECT_EQ (root["i"].integer (), 7);
  EXPECT_EQ (root["i"].number (), 7.0);
  ASSERT_EQ (root["r"].items.size (), 4U);
  EXPECT_EQ (root["r"].items[0].number (), 1.0);
  EXPECT_FALSE (root["r"].items[0].integer ());
  EXPECT_EQ (root["r"].items[1].number (), 0.5);
  EXPECT_EQ (root["r"].items[2].number (), -25.0);
  EXPECT_EQ (root["r"].items[3].integer (), 3);
  EXPECT_EQ (root["t"].type, YamlNode::Type::kText);
  EXPECT_EQ (root["t"].text, "007");
  EXPECT_FALSE (root["t"].number ());
  EXPECT_EQ (root["m"].items[0]["a"].text, "b'c");
  EXPECT_EQ (root["m"].items[1].text, "plain text");
  EXPECT_EQ (root["s"].type, YamlNode::Type::kText);
  EXPECT_EQ (root["n"].type, YamlNode::Type::kNone);
  EXPECT_EQ (root["nowhere"]["at"]["all"].type, YamlNode::Type::kNone);
}

TEST (YamlTree, json_has_tabs_escapes_and_no_spaces)
{
  const YamlNode root =
      tree ("{\n\t\"a\":1,\"b\":[1,2.5,-3e2],\r\n\t\t\"c\" : "
            "\"\\u00e9\\/\\n\\\"\\\\\\'\",\"d\":{\"e\":\"\"},\"f\":{},\"g\":[]\n}\n");
  EXPECT_EQ (root["a"].integer (), 1);
  EXPECT_EQ (root["b"].items[2].number (), -300.0);
  EXPECT_EQ (root["c"].text, "\u00e9/\n\"\\'");
  EXPECT_EQ (root["d"]["e"].type, YamlNode::Type::kText);
  EXPECT_EQ (root["f"].type, YamlNode::Type::kMap);
  EXPECT_EQ (root["g"].type, YamlNode::Type::kList);
}

TEST (YamlTree, other_formats_are_refused)
{
  for (const char *text :
      {"", "\n", "a: 1\n", "<?xml version=\"1.0\"?>\n", "\xff\xfe%\0Y\0", "[1]"})
    expect_refused (text, "must begin with %YAML or {");
  expect_refused (kHead + "- 1\n", "is not a map of fields");
  expect_refused (kHead + "text\n", "is not a map of fields");
  expect_refused ("%YAML:1.0\n", "is not a map of fields");
  expect_refused (kHead + "a: 1\n---\nb: 2\n", "more than one document");
}

TEST (YamlTree, message_names_the_line)
{
  expect_refused (kHead + "a: 1\nb: [ 1, 2\nc: 3\n", "line 5: ");
  expect_refused ("{ \"a\": 1,\n  \"b\": }}\n", "line 2: ");
  expect_refused (kHead + "a: \"\\q\"\n", "line 3: ");
  expect_refused (kHead + "a: 1\n\tb: 2\n", "line 4: ");
}

TEST (YamlTree, aliases_are_refused)
{
  expect_refused (kHead + "a: &x [ 1 ]\nb: *x\n", "line 4: an alias");
  std::string bomb = kHead + "a0: &a0 [ 1, 1, 1, 1, 1, 1, 1, 1, 1 ]\n";
  for (int i = 1; i < 20; i++) {
    const std::string last = "*a" + std::to_string (i - 1);
    bomb += "a" + std::to_string (i) + ": &a" + std::to_string (i) + " [ " +
            repeated (last + ", ", 8) + last + " ]\n";
  }
  expect_refused (bomb, "an alias");
}

TEST (YamlTree, deep_nesting_is_refused)
{
  constexpr int kDeep = 300000;
  for (const std::string part : {"[\n ", "[", "- ", "{a: ", "{a: [", "? ", "&a [", "!a ["})
    for (int count : {kMaxYamlDepth, 1000, kDeep}) {
      YamlNode root;
      EXPECT_EQ (
          read_text (kHead + "a: " + repeated (part, count), root).code (), StatusCode::kBadData)
          << part;
    }
  expect_refused ("{\"a\":" + repeated ("[", kDeep), "nested more than 32 deep");
  const std::string deepest = repeated ("[", kMaxYamlDepth - 1) + repeated ("]", kMaxYamlDepth - 1);
  EXPECT_EQ (tree ("{\"a\":" + deepest + "}").items.size (), 1U);
  expect_refused ("{\"a\":[" + deepest + "]}", "nested more than 32 deep");
}

TEST (YamlTree, too_many_values_are_refused)
{
  const std::string most = repeated ("1,", kMaxYamlNodes - 2);
  EXPECT_EQ (tree ("{\"a\":[" + most + "]}")["a"].items.size (), std::size_t (kMaxYamlNodes - 2));
  expect_refused ("{\"a\":[1," + most + "]}", "more than 100000 values");
}

TEST (YamlTree, control_characters_and_malformed_utf8_are_refused)
{
  expect_refused (kHead + "a: 1" + std::string (40, '\0') + "\n", "control characters");
  expect_refused (kHead + "a: \x01\n", "control characters");
  expect_refused (kHead + "a: \"\xc3(\"\n", "UTF-8");
}

TEST (YamlTree, every_truncated_prefix_is_refused_or_read)
{
  const std::string text =
      kHead + "a: [ 1., \"x\\n\" ]\nb:\n   - c: 'd'\n     e: { f: !!str 1 }\n...\n";
  for (std::size_t size = 0; size <= text.size (); size++) {
    YamlNode root;
    (void)read_text (text.substr (0, size), root);
  }
  EXPECT_EQ (tree (text)["b"].items[0]["e"]["f"].text, "1");
}

TEST (YamlTree, limit_counts_bytes)
{
  const std::string path = temporary ("tree.yml");
  const std::string text = kHead + "a: 1\n" + repeated ("# " + std::string (1021, 'x') + "\n", 100);
  std::ofstream (path) << text;
  YamlNode root;
  EXPECT_TRUE (read_yaml (path, text.size (), root).ok ());
  EXPECT_EQ (root["a"].integer (), 1);
  EXPECT_NE (read_yaml (path, text.size () - 1, root).message ().find ("bytes"), std::string::npos);
  std::filesystem::remove (path);
  EXPECT_EQ (read_yaml (path, kLimit, root).code (), StatusCode::kNotFound);
}
