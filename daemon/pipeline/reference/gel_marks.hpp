#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "daemon/recon/rectify.hpp"

namespace dtact::pipeline {

/// The fine detail of a reference image: bubbles, dust and old dents, which belong to the gel,
/// and stripes, dust on the lens and compression, which belong to the camera.
class GelMarks {
 public:
  /// `reference_q8`: Q8 luma, row-major without padding, `frame_width` wide; only `part` counts.
  /// Detail between about 1 and 4 pixels of an image 640 wide (0.05 to 0.2 mm, sensors a and b),
  /// without what is common to a row or a column, clipped at four standard deviations.
  GelMarks(std::span<const std::uint16_t> reference_q8, int frame_width,
           const recon::FrameRegion& part);

  /// How the gel's marks went: about the middle of the part and by whole pixels.
  struct Move {
    int x = 0;            ///< To the right.
    int y = 0;            ///< Down.
    double turn_deg = 0;  ///< Clockwise, as the image is seen.
    /// By how many standard deviations it stands out.
    double strength = 0;
  };

  /// The correlation of two images of one still sensor is symmetric: equal at a displacement and at
  /// its opposite. Where it is not, some of the marks have moved, even if
  /// others, the camera's own, have not. The search goes by patches, so that turns of up to five
  /// degrees are found, and extends kReach pixels each way. Empty: no move of at least
  /// kMin pixels is certain, or there are no marks to compare. Two references of one real sensor
  /// give at most 5.6; with all but the stripes of one moved by 2 to 12 pixels, 21 to 36
  /// (sensors a and b; real_marks_test).
  [[nodiscard]] std::optional<Move> moved_to(const GelMarks& now) const;

  /// The region of the frame, as given.
  [[nodiscard]] const recon::FrameRegion& part() const noexcept { return part_; }

  static constexpr int kReach = 16;
  static constexpr int kMin = 2;
  static constexpr double kSure = 8;

 private:
  recon::FrameRegion part_;
  std::vector<std::int16_t> detail_;
};

}  // namespace dtact::pipeline
