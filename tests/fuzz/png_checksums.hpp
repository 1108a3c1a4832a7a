#pragma once

#include <zlib.h>

#include <cstddef>
#include <cstdint>
#include <string>

namespace dtact::fuzz {

/// Makes the checksums of a PNG's chunks right (PNG specification, 5.3: length, type, data, CRC-32
/// over type and data). A mutated file would else be refused by its first checksum.
inline std::string with_right_checksums(std::string png) {
  constexpr std::size_t kSignature = 8;
  const auto byte = [&png](std::size_t i) { return static_cast<unsigned char>(png[i]); };
  std::size_t at = kSignature;
  while (at + 12 <= png.size()) {
    const std::size_t length = std::size_t{byte(at)} << 24U | std::size_t{byte(at + 1)} << 16U |
                               std::size_t{byte(at + 2)} << 8U | byte(at + 3);
    if (length > png.size() - at - 12) break;
    const auto crc = ::crc32(0, reinterpret_cast<const Bytef*>(png.data() + at + 4),
                             static_cast<uInt>(length + 4));
    for (std::size_t i = 0; i < 4; ++i) {
      png[at + 8 + length + i] = static_cast<char>(crc >> (24 - 8 * i));
    }
    at += 12 + length;
  }
  return png;
}

}  // namespace dtact::fuzz
