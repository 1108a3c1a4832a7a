#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "hal/luma/luma_buffer.hpp"

namespace dtact::hal::replay {

/// A folder of frames in memory: *.png, decoded, or *.jpg and *.jpeg, as they are; never both. They
/// are in the order of their names. `timestamps.csv` beside them, if there, says when each was
/// taken: lines of "file name,nanoseconds", rising, one for each frame, after an optional first
/// line that names the columns.
struct Recording {
  int width = 0;                         ///< Pixels, of every frame.
  int height = 0;                        ///< Pixels.
  std::vector<luma::LumaBuffer> images;  ///< Of a PNG recording.
  std::vector<std::string> payloads;     ///< Of a JPEG recording.
  /// When each frame comes, nanoseconds after the first; empty without timestamps.csv.
  std::vector<std::int64_t> offsets_ns;

  [[nodiscard]] bool is_jpeg() const noexcept { return images.empty(); }
  [[nodiscard]] std::size_t count() const noexcept {
    return is_jpeg() ? payloads.size() : images.size();
  }
};

/// Recordings that need more memory than this are refused (PNG: about 2,100 frames of 800×600).
inline constexpr std::size_t kMostBytes = std::size_t{1} << 30U;

/// Reads the whole folder. Throws std::runtime_error naming the file (and line) and the remedy: no
/// frames, both kinds, different sizes, an unreadable file, too much memory, bad timestamps.
[[nodiscard]] Recording load_recording(const std::filesystem::path& folder);

}  // namespace dtact::hal::replay
