#pragma once

#include <memory>

#include "daemon/recon/model.hpp"
#include "tests/accuracy/table/methods.hpp"

namespace dtact::table {

/// The paper's linear regression over presses anywhere: depth = (k_c·r + b_c)·ΔI, where r is the
/// distance from (u_c, v_c). As it is described there: truth is the sphere in the published circle;
/// each pixel gets a slope, by least squares over the presses whose circle holds it; a line is
/// fitted through the slopes against r. Brightening is 0, and the depth is smoothed as much as by
/// two 7×7 Gaussian filters. `right_mm`, `down_mm`: (u_c, v_c) from the crop's centre.
[[nodiscard]] std::shared_ptr<const recon::Model> fit_regression(const Material& material,
                                                                 double right_mm, double down_mm);

}  // namespace dtact::table
