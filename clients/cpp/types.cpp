#include "clients/cpp/types.hpp"

#include <limits>

namespace dtact::client {

float DepthMap::millimetres(std::size_t index) const noexcept {
  const std::int16_t value = values[index];
  if (value == untrusted) return std::numeric_limits<float>::quiet_NaN();
  return static_cast<float>(value * um_per_unit * 1e-3);
}

std::vector<float> DepthMap::millimetres() const {
  std::vector<float> mm(values.size());
  for (std::size_t i = 0; i < mm.size(); ++i) mm[i] = millimetres(i);
  return mm;
}

}  // namespace dtact::client
