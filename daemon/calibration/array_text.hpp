#pragma once

#include <fmt/format.h>

#include <cstddef>
#include <string>
#include <vector>

namespace dtact::calibration {

/// A TOML array, broken into lines that an editor can show.
template <typename Value>
std::string array_text(const std::vector<Value>& values) {
  constexpr std::size_t kPerLine = 16;
  std::string out = "[";
  for (std::size_t i = 0; i < values.size(); ++i) {
    out += i % kPerLine == 0 ? "\n  " : " ";
    out += fmt::format("{},", values[i]);
  }
  return out + "\n]";
}

}  // namespace dtact::calibration
