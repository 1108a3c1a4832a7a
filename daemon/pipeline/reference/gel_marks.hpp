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

  /// The correlation of two images of one still sensor is the same at a displacement and at its
  /// opposite, whatever belongs to whom. Where it is not, some of the marks have moved, even if
  /// others, the camera's own, have not. Looked for in patches, so that turns out to five degrees
  /// are found as well, and out to kReach pixels each way. Empty: nothing is sure to have moved by
  /// kMin pixels, or there are no marks to tell by. Two references of one real sensor stand out
  /// by at most 5.6; with all but the stripes of one moved by 2 to 12 pixels, by 21 to 36
  /// (sensors a and b; real_marks_test).
  [[nodiscard]] std::optional<Move> moved_to(const GelMarks& now) const;

  /// Of the frame, as given.
  [[nodiscard]] const recon::FrameRegion& part() const noexcept { return part_; }

  static constexpr int kReach = 16;
  static constexpr int kMin = 2;
  static constexpr double kSure = 8;

 private:
  recon::FrameRegion part_;
  std::vector<std::int16_t> detail_;
};

}  // namespace dtact::pipeline
