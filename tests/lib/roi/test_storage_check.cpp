/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "../test-support.hpp"

#include <fstream>
#include <opencv2/core/persistence.hpp>
#include <rangecast/rigfile/rig_file.hpp>
#include <rangecast/roi/background.hpp>
#include <rangecast/roi/storage_check.hpp>
#include <unistd.h>
#include <zlib.h>

using namespace rangecast;
using rangecast::testing::ring_rig;

namespace {

/* A file that goes with its scope. */
class TestFile {
public:
  TestFile (const std::string &name, const std::string &text = "")
      : path_ (::testing::TempDir () + std::to_string (getpid ()) + "-" + name)
  {
    std::ofstream (path_) << text;
  }
  ~TestFile () { std::filesystem::remove (path_); }
  [[nodiscard]] const std::string &path () const { return path_; }

private:
  std::string path_;
};

std::string
repeated (const std::string &text, int count)
{
  std::string all;
  for (int i = 0; i < count; i++)
    all += text;
  return all;
}

void
expect_refused (const TestFile &file, const char *why)
{
  const Status status = check_storage (file.path (), {.binary_type = "8f"});
  EXPECT_EQ (status.code (), StatusCode::kBadData);
  EXPECT_TRUE (status.message ().starts_with (file.path ()));
  EXPECT_NE (status.message ().find (why), std::string::npos) << status.message ();
  Rig rig;
  EXPECT_EQ (load_rig (file.path (), rig).code (), StatusCode::kBadData);
  std::vector<std::pair<int, BackgroundModel>> views;
  EXPECT_EQ (load_backgrounds (file.path (), views).code (), StatusCode::kBadData);
}

std::string
matrix_text (const char *name, int type)
{
  cv::FileStorage file (
      name, cv::FileStorage::WRITE | cv::FileStorage::MEMORY | cv::FileStorage::BASE64);
  file << "pixels"
       << cv::Mat (cv::Mat::ones (2, 3 * CV_MAT_CN (type), CV_MAT_DEPTH (type)))
              .reshape (CV_MAT_CN (type));
  return file.releaseAndGetString ();
}

TEST (StorageCheck, collections_nested_without_end_are_refused)
{
  constexpr int kDeep = 300000; /* of which each ends a process that reads it */
  const char *kinds[][3] = {{"a.yml", "%YAML:1.0\n---\na: ", "[\n "},
      {"b.yml", "%YAML:1.0\n---\na:\n   ", "- "}, {"c.yml", "%YAML:1.0\n---\n", "a:"},
      {"d.json", "{ \"a\": ", "[\n"}, {"e.json", "", "{ \"a\": "}};
  for (const auto &[name, begin, part] : kinds)
    expect_refused (TestFile (name, begin + repeated (part, kDeep)), "lists, maps or fields");
}

TEST (StorageCheck, as_many_collections_as_are_let_through_do_no_harm)
{
  for (const char *part : {"[\n ", "- ", "a:"}) {
    const TestFile file ("a.yml", "%YAML:1.0\n---\na: " + repeated (part, 9990));
    EXPECT_TRUE (check_storage (file.path ()).ok ());
    Rig rig;
    EXPECT_EQ (load_rig (file.path (), rig).code (), StatusCode::kBadData);
  }
  const TestFile file ("a.json", repeated ("{ \"a\": ", 4990));
  EXPECT_TRUE (check_storage (file.path ()).ok ());
  Rig rig;
  EXPECT_EQ (load_rig (file.path (), rig).code (), StatusCode::kBadData);
}

TEST (StorageCheck, binary_data_without_a_type_are_refused)
{
  /* OpenCV would read these forever. */
  const std::string nothing (64, 'A');
  expect_refused (
      TestFile ("a.yml", "%YAML:1.0\n---\na: !!binary |\n    " + nothing + "\n"), "binary");
  expect_refused (
      TestFile ("b.yml", "%YAML:1.0\n---\na: !<tag:yaml.org,2002:binary> |\n  " + nothing + "\n"),
      "binary");
  expect_refused (TestFile ("c.json", "{ \"a\": \"$base64$" + nothing + "\" }\n"), "binary");
}

TEST (StorageCheck, signs_before_binary_data_are_refused)
{
  /* "8f", as OpenCV writes it before the data */
  const std::string data = "OGYgICAgICAgICAgICAgICAgICAgICAgAAAgQQAAoEEAAPBBAACAPwAA";
  for (const char *sign : {"'", "\"", ">", "|"}) {
    expect_refused (
        TestFile ("a.yml", "%YAML:1.0\n---\na: !!binary |\n    " + (sign + data) + "\n"), "binary");
    expect_refused (
        TestFile ("b.json", "{ \"a\": \"$base64$" + (sign + data) + "\" }\n"), "binary");
  }
  expect_refused (TestFile ("c.json", "{ \"a\": \"$base64$ " + data + "\" }\n"), "binary");
}

TEST (StorageCheck, control_characters_are_refused)
{
  expect_refused (
      TestFile ("a.yml", "%YAML:1.0\n---\na: -$--\n" + std::string (40, '\0') + "a: 1\n"),
      "control");
  const TestFile good ("c.yml", "%YAML:1.0\n---\na:\t\"\xc3\xa9\"\r\n");
  EXPECT_TRUE (check_storage (good.path ()).ok ());
}

/* Of each of them OpenCV leaves a rest, at which it may never end. */
TEST (StorageCheck, yaml_that_is_not_one_map_at_the_beginning_of_lines_is_refused)
{
  const std::string head = "%YAML:1.0\n---\n";
  for (const std::string &text :
      {head + " a: 1\ns:\n   - 1\n", head + "- 1\ns:\n   - 1\n", head + "{a: 1}\ns:\n   - 1\n",
          head + "[1]\ns:\n   - 1\n", head + "!!str a\n", std::string ("%YAML:1.0\n ---\na: 1\n")})
    expect_refused ({"shape.yml", text}, "does not begin with a field");
  for (const std::string &text : {std::string ("%YAML:1.0\n--- a: 1\ns:\n   - 1\n"),
           std::string ("\xef\xbb\xbf%YAML:1.0\n--- a: 1\ns:\n   -\n\n"),
           head + "a: 1\n...\ns:\n   - 1\n", head + "a: 1\n... s\n", head + "a: 1\n---\nb: 2\n"})
    expect_refused ({"shape.yml", text}, "more than one document");
  expect_refused ({"shape.yml", head + "\ra: 1\ns:\n   - 1\n"}, "carriage return");
}

TEST (StorageCheck, yaml_with_comments_windows_lines_and_an_end_passes)
{
  const TestFile file ("shape.yml",
      "\xef\xbb\xbf%YAML:1.0\r\n# of ours\r\n\r\n--- # begins\r\n\r\n"
      "  # still to come\r\na: 1\r\nb:\r\n   - 2\r\n...\r\n# that was it\r\n");
  EXPECT_TRUE (check_storage (file.path ()).ok ());
}

TEST (StorageCheck, xml_is_refused)
{
  for (const char *text : {"<?xml version=", /* which ends a process that reads it */
           "\xef\xbb\xbf\n <?xml version=\"1.0\"?>\n<opencv_storage>\n</opencv_storage>\n"})
    for (const char *name : {"a.yml", "a.xml"})
      expect_refused ({name, text}, "is XML; expected YAML or JSON");
}

TEST (StorageCheck, binary_data_are_found_wherever_blocks_end)
{
  for (int before = 65536 - 600; before < 65536 + 40; before += 7) {
    const TestFile file ("a.yml", "%YAML:1.0\n---\n#" + std::string (std::size_t (before), 'x') +
                                      "\na: !!binary |\n    " + std::string (64, 'A') + "\n");
    EXPECT_FALSE (check_storage (file.path (), {.binary_type = "8f"}).ok ()) << before;
  }
}

TEST (StorageCheck, matrices_of_the_expected_type_pass)
{
  for (const char *name : {"a.yml", "b.json"}) {
    const TestFile right (name, matrix_text (name, CV_32FC (8))),
        other (name, matrix_text (name, CV_8UC3));
    EXPECT_FALSE (check_storage (other.path (), {.binary_type = "8f"}).ok ()) << name;
    EXPECT_FALSE (check_storage (TestFile (name, matrix_text (name, CV_32FC (8))).path ()).ok ());
    const TestFile again (name, matrix_text (name, CV_32FC (8)));
    EXPECT_TRUE (check_storage (again.path (), {.binary_type = "8f"}).ok ()) << name;
  }
}

TEST (StorageCheck, largest_rig_passes)
{
  Rig rig = ring_rig (kMaxViews);
  for (View &view : rig.views) {
    PartnerCamera partner;
    partner.camera = "binary";
    partner.intrinsics = view.intrinsics;
    partner.partner_from_left.translation = {-0.1, 0, 0};
    view.name = "a view: [ of { many } ] <-> binary";
    view.right = view.third = partner;
  }
  for (const char *name : {"a.yml", "b.json"}) {
    const TestFile file (name);
    ASSERT_TRUE (save_rig (file.path (), rig).ok ());
    EXPECT_TRUE (check_storage (file.path ()).ok ()) << check_storage (file.path ()).message ();
    Rig again;
    EXPECT_TRUE (load_rig (file.path (), again).ok ());
  }
}

TEST (StorageCheck, file_that_unpacks_to_more_than_the_limit_is_refused)
{
  const TestFile file ("a.yml.gz");
  const std::unique_ptr<gzFile_s, int (*) (gzFile)> packed (
      gzopen (file.path ().c_str (), "wb"), gzclose);
  const std::string line = "# " + std::string (1021, 'x') + "\n";
  for (int i = 0; i < 8 << 10; i++)
    gzwrite (packed.get (), line.data (), unsigned (line.size ()));
  gzflush (packed.get (), Z_FINISH);
  EXPECT_LT (std::filesystem::file_size (file.path ()), 1u << 20);
  EXPECT_TRUE (check_storage (file.path (), {.max_bytes = 9 << 20}).ok ());
  const Status status = check_storage (file.path (), {.max_bytes = 7 << 20});
  EXPECT_NE (status.message ().find ("bytes"), std::string::npos) << status.message ();
  Rig rig;
  EXPECT_EQ (load_rig (file.path (), rig).code (), StatusCode::kBadData);
}

TEST (StorageCheck, compressed_file_is_looked_into_and_must_say_so)
{
  const std::string text = "%YAML:1.0\n---\na: " + repeated ("[\n ", 20000);
  const TestFile named ("a.yml.gz"), hidden ("a.yml");
  {
    cv::FileStorage file (named.path (), cv::FileStorage::WRITE);
    file << "a"
         << "[";
    for (int i = 0; i < 20000; i++)
      file << "["
           << "]";
    file << "]";
  }
  EXPECT_FALSE (check_storage (named.path ()).ok ());
  std::filesystem::copy_file (
      named.path (), hidden.path (), std::filesystem::copy_options::overwrite_existing);
  const Status status = check_storage (hidden.path ());
  EXPECT_NE (status.message ().find ("compressed"), std::string::npos) << status.message ();
}

} // namespace
