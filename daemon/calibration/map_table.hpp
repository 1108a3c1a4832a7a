#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "daemon/recon/lens.hpp"
#include "daemon/recon/model.hpp"

namespace dtact::calibration {

/// The rectification of a depth map: through the lens, or the crop where there is none. `outside`
/// becomes depth-map sized with 1 where the frame does not show the pixel, or empty. Throws
/// std::invalid_argument as recon::make_crop_table() and recon::make_lens_table().
[[nodiscard]] recon::RectifyTable map_table(const std::optional<recon::Lens>& lens, int frame_width,
                                            int frame_height, const recon::MapPlace& place,
                                            std::vector<std::uint8_t>& outside);

/// Marks in the model what `outside` marks.
void add_untrusted(recon::Model& model, const std::vector<std::uint8_t>& outside);

}  // namespace dtact::calibration
