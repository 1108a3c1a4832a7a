#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "hal/luma/luma.hpp"
#include "hal/mjpeg/grey_decoder.hpp"

namespace dtact::hal::replay {

/// A folder of frames in memory: *.png, decoded, or *.jpg and *.jpeg, as they are; never both. They
/// are in the natural order of their names, hidden files left out. `timestamps.csv` beside them, if
/// there, says when each was taken: lines of "file name,nanoseconds", rising, one for each frame,
/// after an optional first line that names the columns. Or the camera's JPEGs of an MCAP file
/// (dtactctl record): the messages of its one channel of foxglove.CompressedImage, in the order of
/// their log times.
struct Recording {
  int width = 0;                         ///< Pixels, of every frame.
  int height = 0;                        ///< Pixels.
  std::vector<luma::LumaBuffer> images;  ///< for a PNG recording
  std::vector<std::string> payloads;     ///< for a JPEG recording
  std::vector<std::string> names;        ///< of the payloads, for messages
  /// Time of each frame, nanoseconds after the first; empty without timestamps.csv.
  std::vector<std::int64_t> offsets_ns;
  /// What of an MCAP file cannot be played, and why; empty: nothing is left out.
  std::string left_out;

  [[nodiscard]] bool is_jpeg() const noexcept { return images.empty(); }
  [[nodiscard]] std::size_t count() const noexcept {
    return is_jpeg() ? payloads.size() : images.size();
  }
};

/// Recordings that need more memory than this are refused (PNG: about 2,100 frames of 800×600).
inline constexpr std::size_t kMaxBytes = std::size_t{1} << 30U;

/// Reads the whole folder, or a file whose name ends in .mcap. Of a damaged MCAP file it reads what
/// is there and leaves out frames that are no JPEG of the first one's size. Throws
/// std::runtime_error naming the file (and line) and the fix: no frames, both kinds, different
/// sizes, an unreadable file, too much memory, bad timestamps.
[[nodiscard]] Recording load_recording(const std::filesystem::path& path);

/// Between the first and the last frame: a year. Longer ones are another unit, and would overflow.
inline constexpr std::int64_t kLongestNs = std::int64_t{366} * 24 * 3600 * 1'000'000'000;

// The parts that both kinds of recordings share.

/// Throws std::runtime_error naming `where`.
[[noreturn]] void fail(const std::filesystem::path& where, const std::string& what);
/// Appends a JPEG, whose header must be whole and have the size of those before it.
void add_jpeg(Recording& recording, std::string payload, mjpeg::GreyDecoder& decoder,
              const std::filesystem::path& name);
/// The file of that name, whatever it ends in.
[[nodiscard]] Recording load_mcap(const std::filesystem::path& file);

}  // namespace dtact::hal::replay
