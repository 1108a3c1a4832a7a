#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "clients/calibrate/fit/evaluate.hpp"
#include "clients/calibrate/offline/images.hpp"
#include "daemon/calibration/calibration.hpp"
#include "tests/accuracy/real/pin_depths.hpp"

namespace dtact::ctl {

/// Results from a folder of a sensor's images: `board_reference.png` and `board.png`,
/// `ball_reference.png` and `ball.png`. Results that could not be computed are empty, with a
/// reason.
struct FolderEvaluation {
  std::optional<PinPress> pins;
  PinGain gain;                                         ///< The gain that the pins select.
  std::string no_pins;                                  ///< Why there is no lens.
  std::optional<calibration::Calibration> calibration;  ///< From the ball, on the rectified image.
  std::optional<calibration::Evaluation> ball;
  std::string no_ball;
  std::optional<PinDepths> pin_depths;
  std::string no_pin_depths;
  ImageSet board_reference;
  ImageSet board;
  ImageSet ball_reference;
  ImageSet ball_images;
};

/// Evaluates a folder. The lens has the scale, from the board's pitch. Throws
/// std::runtime_error when the folder is missing or an image cannot be read.
[[nodiscard]] FolderEvaluation evaluate_folder(const std::filesystem::path& folder,
                                               const Board& board, double ball_radius_mm);

/// Writes a page of pictures: index.html and PNG files, completely or not at all; replaces an old
/// page. `name` is the page's title.
void write_page(const FolderEvaluation& evaluation, const std::string& name,
                const std::filesystem::path& folder);

/// The evaluation's lines, as the command prints them and the page shows them.
[[nodiscard]] std::vector<std::string> lines_of(const FolderEvaluation& evaluation);

}  // namespace dtact::ctl
