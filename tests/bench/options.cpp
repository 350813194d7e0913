/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "options.hpp"

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <rangecast/scene/scene.hpp>
#include <sstream>

namespace {

/* All of `text` as a number within limits. */
template <typename T>
bool
read_number (const std::string &text, T &to, T least, T most)
{
  T value{};
  const char *end = text.data () + text.size ();
  const auto [stop, error] = std::from_chars (text.data (), end, value);
  if (error != std::errc{} || stop != end || !(value >= least && value <= most))
    return false;
  to = value;
  return true;
}

template <typename T>
Options::Take
number_taker (T &to, T least, T most)
{
  return [&to, least, most] (const std::string &value) -> std::string {
    if (read_number (value, to, least, most))
      return {};
    std::ostringstream expected;
    expected << (std::is_integral_v<T> ? "a whole number" : "a number") << " from " << least
             << " to " << most;
    return expected.str ();
  };
}

} // namespace

Options::Options (std::string program, std::string usage)
    : program_ (std::move (program)), usage_ (std::move (usage))
{
}

void
Options::flag (const std::string &name, bool &to)
{
  flags_[name] = &to;
}

void
Options::text (const std::string &name, std::string &to)
{
  values_[name] = [&to] (const std::string &value) -> std::string {
    to = value;
    return value.empty () ? "a name" : "";
  };
}

void
Options::number (const std::string &name, int &to, int least, int most)
{
  values_[name] = number_taker (to, least, most);
}

void
Options::number (const std::string &name, double &to, double least, double most)
{
  values_[name] = number_taker (to, least, most);
}

void
Options::size (const std::string &name, int &width, int &height, int least, int most)
{
  values_[name] = [&width, &height, least, most] (const std::string &value) -> std::string {
    const std::size_t x = value.find ('x');
    if (x != std::string::npos && read_number (value.substr (0, x), width, least, most) &&
        read_number (value.substr (x + 1), height, least, most))
      return {};
    return "WIDTHxHEIGHT, each from " + std::to_string (least) + " to " + std::to_string (most);
  };
}

void
Options::value (const std::string &name, Take take)
{
  values_[name] = std::move (take);
}

std::optional<int>
Options::parse (int argc, char **argv)
{
  for (int i = 1; i < argc; i++) {
    const std::string name = argv[i];
    if (name == "--help" || name == "-h") {
      std::fputs (usage_.c_str (), stdout);
      return 0;
    }
    if (const auto flag = flags_.find (name); flag != flags_.end ()) {
      *flag->second = true;
      continue;
    }
    const auto taker = values_.find (name);
    if (taker == values_.end ())
      return refuse ("unknown option '" + name + "'");
    if (++i == argc)
      return refuse ("option " + name + " needs a value");
    if (const std::string expected = taker->second (argv[i]); !expected.empty ())
      return refuse (name + " " + argv[i] + ": expected " + expected);
  }
  return {};
}

int
Options::refuse (const std::string &message) const
{
  std::fprintf (stderr, "%s: %s (--help lists the options)\n", program_.c_str (), message.c_str ());
  return 2;
}
