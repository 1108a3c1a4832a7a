#pragma once

#include <algorithm>
#include <cstddef>
#include <string>

namespace dtact::base {

/// The beginning of a UTF-8 text: at most `most` bytes, without a partial character.
inline std::string first_bytes(const std::string& text, std::size_t most) {
  std::size_t end = std::min(text.size(), most);
  const auto continues = [&text](std::size_t at) {
    return (static_cast<unsigned char>(text[at]) & 0xC0U) == 0x80U;
  };
  while (end > 0 && end < text.size() && continues(end)) --end;
  return text.substr(0, end);
}

}  // namespace dtact::base
