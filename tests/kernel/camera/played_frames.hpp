#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "hal/files/png.hpp"
#include "hal/frame.hpp"

namespace dtact::kernel_test {

/// A grey picture as the JPEG that a USB camera would send (4:2:2, grey chroma).
[[nodiscard]] std::string encode_jpeg(const image::Grey8& picture);

/// Eight pictures of 800×600 for the fake camera to play: files in a folder of their own, and the
/// luma that must leave the HAL, bit for bit.
class PlayedFrames {
 public:
  static constexpr int kWidth = 800;
  static constexpr int kHeight = 600;
  static constexpr int kCount = 8;

  /// Writes the files: JPEG (4:2:2, as USB cameras send it) and YUYV of limited range.
  PlayedFrames();
  PlayedFrames(const PlayedFrames&) = delete;
  PlayedFrames& operator=(const PlayedFrames&) = delete;
  ~PlayedFrames();

  [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }
  /// The number of the picture that the frame equals exactly; −1 = none.
  [[nodiscard]] int match_jpeg(const hal::LumaView& luma) const { return match(jpeg_luma_, luma); }
  [[nodiscard]] int match_yuyv(const hal::LumaView& luma) const { return match(yuyv_luma_, luma); }

 private:
  using Image = std::vector<std::uint8_t>;
  [[nodiscard]] static int match(const std::vector<Image>& images, const hal::LumaView& luma);

  std::filesystem::path folder_;
  std::vector<Image> jpeg_luma_;
  std::vector<Image> yuyv_luma_;
};

}  // namespace dtact::kernel_test
