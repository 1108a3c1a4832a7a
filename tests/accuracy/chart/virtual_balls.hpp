#pragma once

#include "daemon/recon/model.hpp"
#include "hal/files/png.hpp"

namespace dtact::chart {

/// The model with the scattering of the built-in sensor's own optics and lists, for no, one and two
/// steps of sharpening, made from balls of 1.5 to 8 mm radius on that sensor: the mean true
/// indentation at every level, as it is read at a quarter of the resolution, zero at zero. What a
/// perfect fit of the sensor would give and thus a bound for any: none of the objects that are
/// judged is among the balls' presses, but the optics are.
[[nodiscard]] recon::Model with_luts_of_virtual_balls(recon::Model model,
                                                      const image::Grey16& reference);

}  // namespace dtact::chart
