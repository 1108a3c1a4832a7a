#pragma once

#include <algorithm>
#include <cstddef>
#include <string>
#include <string_view>

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

/// Number of bytes of the character that the text begins with; 0: it begins with none. No cut or
/// overlong character, no half of a pair, nothing above U+10FFFF (Unicode 15, table 3-7).
inline std::size_t character_size(std::string_view text) {
  const auto byte_at = [&](std::size_t at) {
    return at < text.size() ? static_cast<unsigned char>(text[at]) : 0U;
  };
  const unsigned first = byte_at(0);
  const std::size_t size = first < 0x80 ? 1 : first < 0xE0 ? 2 : first < 0xF0 ? 3 : 4;
  if (text.empty() || (first >= 0x80 && first < 0xC2) || first > 0xF4) return 0;
  for (std::size_t i = 1; i < size; ++i) {
    if ((byte_at(i) & 0xC0U) != 0x80U) return 0;
  }
  const unsigned second = byte_at(1);
  const bool outside = (first == 0xE0 && second < 0xA0) || (first == 0xED && second > 0x9F) ||
                       (first == 0xF0 && second < 0x90) || (first == 0xF4 && second > 0x8F);
  return outside ? 0 : size;
}

/// Whether the text can be a protobuf `string`.
inline bool is_utf8(std::string_view text) {
  while (!text.empty()) {
    const std::size_t size = character_size(text);
    if (size == 0) return false;
    text.remove_prefix(size);
  }
  return true;
}

/// The text as a protobuf `string` takes it: '?' in place of each byte beyond ASCII where it is not
/// UTF-8.
inline std::string as_utf8(std::string text) {
  if (is_utf8(text)) return text;
  std::ranges::replace_if(text, [](char c) { return static_cast<unsigned char>(c) >= 0x80; }, '?');
  return text;
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
