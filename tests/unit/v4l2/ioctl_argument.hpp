#pragma once

#include <linux/types.h>

#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

namespace dtact::hal::v4l2 {

/// The argument of an emulated ioctl.
template <typename T>
T& as(std::vector<std::uint8_t>& argument) {
  return *reinterpret_cast<T*>(argument.data());
}

/// Fills a kernel's field of characters, which must be zero.
template <std::size_t Size>
void put_text(__u8 (&field)[Size], std::string_view text) {
  text.copy(reinterpret_cast<char*>(field), Size - 1);
}

}  // namespace dtact::hal::v4l2
