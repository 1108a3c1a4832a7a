#include "daemon/recon/depth_lut.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <stdexcept>
#include <string>

#include "daemon/recon/kernels.hpp"

namespace dtact::recon {

void check(const DepthLut& lut, bool monotone) {
  constexpr int kReach = 255 * kEntriesPerLevel;
  if (lut.um.empty()) throw std::invalid_argument("lut.um: must have at least one entry");
  if (lut.um.size() > 2 * kReach + 1 || lut.first_q6 < -kReach ||
      lut.first_q6 + static_cast<int>(lut.um.size()) - 1 > kReach) {
    throw std::invalid_argument("lut.first_q6: the LUT must lie within -16320 to 16320 (" +
                                std::to_string(kEntriesPerLevel) + " entries a grey level)");
  }
  // No gel is that thick, and the published method smooths what the LUT says.
  if (std::ranges::any_of(lut.um, [](int um) { return std::abs(um) > kernels::kSmoothable; })) {
    throw std::invalid_argument("lut.um: entries must be -16383 to 16383 micrometres");
  }
  const auto drop = std::ranges::adjacent_find(lut.um, std::ranges::greater{});
  if (monotone && drop != lut.um.end()) {
    throw std::invalid_argument("lut.um: must not fall, but entry " +
                                std::to_string(drop - lut.um.begin() + 2) +
                                " is below the one before");
  }
  const int last = lut.first_q6 + static_cast<int>(lut.um.size()) - 1;
  if (lut.covered_from_q6 < lut.first_q6 || lut.covered_to_q6 > last ||
      lut.covered_from_q6 > lut.covered_to_q6) {
    throw std::invalid_argument("lut.covered_from_q6, lut.covered_to_q6: must be an interval in " +
                                std::to_string(lut.first_q6) + " to " + std::to_string(last));
  }
}

}  // namespace dtact::recon
