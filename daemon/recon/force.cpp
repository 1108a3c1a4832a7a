#include "daemon/recon/force.hpp"

#include <algorithm>
#include <cmath>

namespace dtact::recon {

Force force_of(const ForceModel& model, double volume_mm3, double area_mm2) noexcept {
  const double v = volume_mm3;
  const double a = area_mm2;
  const double va = v * a;
  const auto& s = model.spread;
  const double leverage = s[0] * v * v + s[3] * a * a + s[5] * va * va +
                          2 * (s[1] * v * a + s[2] * v * va + s[4] * a * va);
  return {std::max(0.0, model.per_mm3 * v + model.per_mm2 * a + model.per_mm5 * va),
          model.error_n * std::sqrt(1 + std::max(0.0, leverage))};
}

}  // namespace dtact::recon
