#pragma once

#include <algorithm>
#include <cstddef>
#include <optional>
#include <vector>

namespace dtact::study {

/// The upper one of two middle values; nothing for an empty vector.
inline std::optional<double> median(std::vector<double> values) {
  if (values.empty()) return std::nullopt;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

}  // namespace dtact::study
