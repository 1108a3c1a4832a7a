#pragma once

#include "daemon/recon/model.hpp"
#include "hal/files/png.hpp"

namespace dtact::chart {

/// The model with the scattering of the built-in sensor's own optics and LUTs for no, one and two
/// steps of sharpening. The LUTs come from balls of 1.5 to 8 mm radius on that sensor: the mean
/// true indentation at every level, read at a quarter of the resolution, zero at zero. A perfect
/// fit of the sensor would give this, so it bounds any: none of the judged objects is among the
/// balls' presses, but the optics are the same.
[[nodiscard]] recon::Model with_luts_of_virtual_balls(recon::Model model,
                                                      const image::Grey16& reference);

}  // namespace dtact::chart
