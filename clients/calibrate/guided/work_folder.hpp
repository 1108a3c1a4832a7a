#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "daemon/calibration/calibration.hpp"
#include "hal/files/png.hpp"

namespace dtact::ctl::guided {

/// A session's captures, so that another session can continue and `dtact-calibrate depth` can read
/// it:
///
///     FOLDER/reference/00.png … sensor.toml     the undeformed surface, camera and light
///     FOLDER/press-01/00.png …                  each press
///     FOLDER/ball.toml                          the radius of the ball that made them
///     FOLDER/calibration/                       the calibration made of them
///     FOLDER/preview.png                        the last picture
///
/// A reference or a press is saved completely or not at all.
class WorkFolder {
 public:
  static constexpr const char* kReference = "reference";

  /// Makes the folder. Throws std::filesystem::filesystem_error.
  explicit WorkFolder(std::filesystem::path path);

  [[nodiscard]] bool has_reference() const;
  /// Names of the presses, in order.
  [[nodiscard]] std::vector<std::string> presses() const;
  /// The name of the next press.
  [[nodiscard]] std::string next_press() const;

  void save_reference(const std::vector<image::Grey8>& frames, const calibration::Origin& origin);
  /// `name`: next_press(), or an existing one, which is replaced.
  void save_press(const std::string& name, const std::vector<image::Grey8>& frames);
  /// Notes the radius of the presses' ball; one already noted must be the same as long as there are
  /// presses. Throws std::runtime_error naming both and the fix.
  void require_ball(double radius_mm) const;
  void save_preview(const image::Rgb8& picture);

  /// The folder's name in the form of a calibration's: letters, digits, '-' and '_', at
  /// most 64.
  [[nodiscard]] std::string calibration_name() const;
  /// Path of a file in the folder, for the command line.
  [[nodiscard]] std::string at(const std::string& name) const { return (path_ / name).string(); }
  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace dtact::ctl::guided
