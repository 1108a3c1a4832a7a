#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "daemon/recon/rectify.hpp"

namespace dtact::pipeline {

/// The fine detail of an untouched image: bubbles, dust and old dents, which belong to the layer,
/// and stripes, dust on the lens and compression, which belong to the camera.
class LayerMarks {
 public:
  /// `reference_q8`: Q8 luma, row-major without padding, `frame_width` wide; only `part` counts.
  /// Detail between about 1 and 4 pixels of an image 640 wide (0.05 to 0.2 mm, sensors a and b),
  /// without what is common to a row or a column, clipped at four standard deviations.
  LayerMarks(std::span<const std::uint16_t> reference_q8, int frame_width,
             const recon::FrameRegion& part);

  /// How far the layer's marks went, whole pixels.
  struct Shift {
    int x = 0;  ///< To the right.
    int y = 0;  ///< Down.
    /// By how many standard deviations it stands out.
    double strength = 0;
  };

  /// The correlation of two images of one still sensor is the same at a displacement and at its
  /// opposite, whatever belongs to whom. Where it is not, some of the marks have moved, even if
  /// others, the camera's own, have not. Looked for on all of the part and on each quarter, for a
  /// turn moves them apart, out to kReach pixels each way. Empty: nothing is sure to have moved by
  /// kLeast pixels, or there are no marks to tell by. Two references of one real sensor stand out
  /// by at most 4; with all but the stripes and rings of one moved by 1 to 6 pixels, by 6 to 17 in
  /// every quarter (sensors a and b; layer_marks_test, real_marks_test).
  [[nodiscard]] std::optional<Shift> moved_to(const LayerMarks& now) const;

  static constexpr int kReach = 16;
  static constexpr int kLeast = 2;
  static constexpr double kSure = 7;

 private:
  int width_;
  int height_;
  std::vector<std::int16_t> detail_;
};

}  // namespace dtact::pipeline
