/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "camera.hpp"

#include <arv.h>

struct Camera::Impl {
  CameraInfo info;
};

Camera::Camera (std::unique_ptr<Impl> impl) : impl_ (std::move (impl)) {}
Camera::~Camera () = default;
