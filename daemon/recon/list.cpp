#include "daemon/recon/list.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <stdexcept>
#include <string>

#include "daemon/recon/kernels.hpp"

namespace dtact::recon {

void check(const DepthList& list, bool monotone) {
  constexpr int kReach = 255 * kEntriesPerLevel;
  if (list.um.empty()) throw std::invalid_argument("list.um: must have at least one entry");
  if (list.um.size() > 2 * kReach + 1 || list.first_q6 < -kReach ||
      list.first_q6 + static_cast<int>(list.um.size()) - 1 > kReach) {
    throw std::invalid_argument("list.first_q6: the list must lie within -16320 to 16320 (" +
                                std::to_string(kEntriesPerLevel) + " entries a grey level)");
  }
  // No layer is that thick, and the published method smooths what the list says.
  if (std::ranges::any_of(list.um, [](int um) { return std::abs(um) > kernels::kSmoothable; })) {
    throw std::invalid_argument("list.um: entries must be -16383 to 16383 micrometres");
  }
  const auto drop = std::ranges::adjacent_find(list.um, std::ranges::greater{});
  if (monotone && drop != list.um.end()) {
    throw std::invalid_argument("list.um: must not fall, but entry " +
                                std::to_string(drop - list.um.begin() + 2) +
                                " is below the one before");
  }
  const int last = list.first_q6 + static_cast<int>(list.um.size()) - 1;
  if (list.covered_from_q6 < list.first_q6 || list.covered_to_q6 > last ||
      list.covered_from_q6 > list.covered_to_q6) {
    throw std::invalid_argument(
        "list.covered_from_q6, list.covered_to_q6: must be an interval in " +
        std::to_string(list.first_q6) + " to " + std::to_string(last));
  }
}

}  // namespace dtact::recon
