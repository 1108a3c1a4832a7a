#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace dtact::ctl {

/// The pictures of a calibration folder: undeformed surface and pressed, of the board of pins and
/// of the ball.
struct ImportPictures {
  std::filesystem::path board_reference;
  std::filesystem::path board;
  std::filesystem::path ball_reference;
  std::filesystem::path ball;
  std::filesystem::path depth_table;  ///< Pixel_to_Depth.npy, which need not be there.
};

/// Finds them as 9DTact and DTact keep them (camera_calibration/{ref,sample}.png and
/// depth_calibration/{ref,sample}.png), else as board_reference.png, board.png, ball_reference.png
/// and ball.png. Throws std::runtime_error naming every picture that is missing, or the folders of
/// single sensors below this one.
[[nodiscard]] ImportPictures find_pictures(const std::filesystem::path& folder);

/// A number of the board, the ball or the camera, and its source.
struct Stated {
  double value = 0;
  std::string by;  ///< "usual", "--pitch-mm", "FILE:12"
};

/// The settings with which the imported calibration was made.
struct ImportSettings {
  Stated rows{7, "usual"};
  Stated cols{9, "usual"};
  Stated pitch_mm{2.5, "usual"};
  Stated radius_mm{4, "usual"};
  Stated fps{30, "usual"};
  std::optional<Stated> width;
  std::optional<Stated> height;
};

/// Takes row_points, col_points, grid_distance, BallRad, fps and resolution from a
/// shape_config.yaml, under whatever heading; other keys are left alone. Throws std::runtime_error
/// with file, line, key and what is allowed.
void read_shape_config(const std::filesystem::path& file, ImportSettings& settings);

/// A row of numbers that NumPy saved, as Pixel_to_Depth.npy: the depth of each grey level,
/// millimetres. Throws std::runtime_error naming the file.
[[nodiscard]] std::vector<double> read_depth_table(const std::filesystem::path& file);

}  // namespace dtact::ctl
