#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "daemon/recon/model.hpp"

namespace dtact::recon {

/// The method `lut` in double precision, written from its definition and sharing no code with the
/// fixed-point version: nothing is rounded or saturated between luma and the LUT, and the LUT is
/// interpolated. `steps` of sharpening, whose Gaussians both run on the map. Micrometres; NaN
/// where the darkening is beyond the LUT's covered range on the deep side or the light too weak.
/// `luma` is frame sized without padding.
[[nodiscard]] std::vector<double> reconstruct_in_double(const Model& model,
                                                        std::span<const std::uint16_t> reference_q8,
                                                        std::span<const std::uint8_t> luma,
                                                        int steps = 0);

}  // namespace dtact::recon
