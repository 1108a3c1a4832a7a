#pragma once

#include <optional>
#include <string>
#include <vector>

#include "clients/calibrate/fit/contact.hpp"
#include "hal/files/png.hpp"

namespace dtact::ctl::guided {

/// Difference of a frame from the undeformed surface, as a picture: light grey outside the contact,
/// four shades darker for each grey level of darkening, lighter where the gel bulges. Both images
/// are the depth map's part, of one size.
[[nodiscard]] image::Grey8 darkening_picture(const image::Grey8& reference,
                                             const image::Grey8& frame);

/// The picture with the contact's circle and width, if any, and a scale bar.
[[nodiscard]] image::Rgb8 annotated(const image::Grey8& picture, double mm_per_px,
                                    const std::optional<calibration::Contact>& contact);

/// The picture as lines of half blocks in the 24 greys of a 256-colour terminal, `columns`
/// characters wide (at most the picture's width); a character shows two pixels, one above the
/// other.
[[nodiscard]] std::vector<std::string> half_blocks(const image::Grey8& picture, int columns);

}  // namespace dtact::ctl::guided
