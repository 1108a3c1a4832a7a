#pragma once

#include <filesystem>
#include <opencv2/core.hpp>
#include <optional>

namespace dtact {

/// An undeformed surface and an object pressed in, a board of pins or a ball: grey levels.
struct PressImages {
  cv::Mat1f reference;
  cv::Mat1f frame;
};

/// The folder of a sensor's real images; nothing when they are not beside the repository.
[[nodiscard]] std::optional<std::filesystem::path> sensor_folder(const char* sensor);
/// `object`: "board" or "ball".
[[nodiscard]] PressImages load_pair(const std::filesystem::path& folder, const char* object);

// Changes as in other sensors of the family. Results are rounded to whole grey levels, as
// a camera would.

/// Portrait: a quarter turn clockwise.
[[nodiscard]] PressImages turned(const PressImages& board);
/// Both images darker towards the corners: 1 − 0.75·(r / corner)².
[[nodiscard]] PressImages dark_corners(const PressImages& board);
/// Pressed in more on one side: the darkening of the whole surface grows by 12 grey levels from the
/// left to the right edge and by 6 from the top to the bottom.
[[nodiscard]] PressImages tilted(const PressImages& board);
/// Light that leaks in at the left edge in one image and at the bottom in the other, up to 60
/// levels.
[[nodiscard]] PressImages leaking(const PressImages& board);
/// Within `radius` pixels of a place, the darkening of the ring around it, with a pixel noise of
/// one grey level: as if the pin were broken off.
[[nodiscard]] PressImages without_pin(const PressImages& board, cv::Point place, double radius);

}  // namespace dtact
