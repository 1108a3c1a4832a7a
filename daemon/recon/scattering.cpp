#include "daemon/recon/scattering.hpp"

#include <stdexcept>

namespace dtact::recon {

void check(const Scattering& scattering) {
  if (!(scattering.narrow_mm >= kNarrowestMm && scattering.narrow_mm <= kWidestNarrowMm)) {
    throw std::invalid_argument("scattering.narrow_mm: must be 0.01 to 5 millimetres");
  }
  if (!(scattering.wide_mm > scattering.narrow_mm && scattering.wide_mm <= kWidestMm)) {
    throw std::invalid_argument(
        "scattering.wide_mm: must be above narrow_mm and at most 20 millimetres");
  }
  if (!(scattering.narrow_weight >= 0 && scattering.narrow_weight <= 1)) {
    throw std::invalid_argument("scattering.narrow_weight: must be 0 to 1");
  }
}

}  // namespace dtact::recon
