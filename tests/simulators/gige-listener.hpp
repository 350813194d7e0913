/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "gige-camera.hpp"

/** Hears what is broadcast to all cameras, discovery and action commands, for all cameras of the
 *  program: a camera's own socket only gets what is sent to its address. */
class GigeListener {
public:
  explicit GigeListener (const std::vector<std::unique_ptr<GigeCamera>> &cameras);
  ~GigeListener ();
  GigeListener (const GigeListener &) = delete;
  GigeListener &operator= (const GigeListener &) = delete;

  /** Listens on every broadcast address of this machine's networks; those that are taken by a
   *  program that does not share them are left out. @return how many */
  std::size_t start ();

private:
  void add_socket (const char *address);
  void run ();
  void receive (int socket);

  const std::vector<std::unique_ptr<GigeCamera>> &cameras_;
  std::vector<int> sockets_;
  int wake_ = -1;
  std::thread thread_;
};
