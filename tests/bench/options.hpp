/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Command lines of the benches. */
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>

/** Reads `--name VALUE` and `--flag`, checks values, and says what was expected where one is wrong.
 *  Targets must outlive parse(). --help is always there. */
class Options {
public:
  /** Takes a value. @return what was expected, or nothing if the value is good */
  using Take = std::function<std::string (const std::string &value)>;

  /** @param usage  what --help prints */
  Options (std::string program, std::string usage);

  void flag (const std::string &name, bool &to);
  void text (const std::string &name, std::string &to);
  void number (const std::string &name, int &to, int least, int most);
  void number (const std::string &name, double &to, double least, double most);
  /** WxH, pixels, each from `least` to `most`. */
  void size (const std::string &name, int &width, int &height, int least, int most);
  void value (const std::string &name, Take take);

  /** @return nothing: go on; else the status to exit with, all being said: 0 after --help, 2 */
  std::optional<int> parse (int argc, char **argv);
  /** Says what is wrong with the command line as a whole. @return the status to exit with, 2 */
  [[nodiscard]] int refuse (const std::string &message) const;

private:
  std::string program_, usage_;
  std::map<std::string, bool *> flags_;
  std::map<std::string, Take> values_;
};
