/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Any bytes as a camera's answer that holds its user-defined name. */
#include "camera/aravis/user_name.hpp"
#include <cstdlib>

extern "C" int
LLVMFuzzerTestOneInput (const std::uint8_t *data, std::size_t size)
{
  if (size < 8)
    return 0;
  /* asked with the number that it answers to */
  const auto name =
      user_name_in ({data, size}, static_cast<std::uint16_t> (data[6] << 8 | data[7]));
  if (name && name->size () > kUserNameSize)
    std::abort ();
  return 0;
}
