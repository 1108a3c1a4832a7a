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

/// The text with '?' in place of control characters, for logs and terminals.
inline std::string printable(std::string text) {
  const auto byte_at = [&text](std::size_t at) {
    return at < text.size() ? static_cast<unsigned char>(text[at]) : 0U;
  };
  for (std::size_t i = 0; i < text.size(); ++i) {
    // Terminals obey U+0080 to U+009F, too.
    const bool second_set = byte_at(i) == 0xC2 && byte_at(i + 1) >= 0x80 && byte_at(i + 1) < 0xA0;
    if (second_set || byte_at(i) < 0x20 || byte_at(i) == 0x7F) {
      text.replace(i, second_set ? 2 : 1, 1, '?');
    }
  }
  return text;
}

}  // namespace dtact::base
