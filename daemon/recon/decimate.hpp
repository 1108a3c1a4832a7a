#pragma once

#include "daemon/recon/model.hpp"

namespace dtact::recon {

/// The model of a map of 1/`factor` the resolution (1, 2 or 4), for hosts that cannot afford the
/// whole: its pixels are means over factor × factor of the model's, taken before smoothing, the
/// smoothing keeps its width in millimetres, and a pixel that covers an untrusted one is untrusted.
/// Columns and rows that fill no pixel are left out on both sides alike, so that the centre stays
/// within half a pixel of `model`. Throws
/// std::invalid_argument for another factor, a map smaller than one pixel or a decimated model.
[[nodiscard]] Model decimate(const Model& model, int factor);

}  // namespace dtact::recon
