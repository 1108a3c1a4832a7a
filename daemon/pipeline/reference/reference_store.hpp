#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "daemon/calibration/calibration.hpp"
#include "hal/light_ring.hpp"

namespace dtact::pipeline {

/// The last good reference as it outlives a restart: `reference.png` (16-bit grey, Q8 luma) and
/// `reference.toml` (what it belongs to) in the state folder.
struct StoredReference {
  int width = 0;   ///< Pixels.
  int height = 0;  ///< Pixels.
  std::vector<std::uint16_t> image_q8;
  hal::Light light;  ///< What the ring showed.
};

/// Replaces the stored reference, each file by write, fsync, rename. The TOML has the image's
/// length and checksum, to detect two files of different ages. Throws std::exception naming the
/// file.
void save_reference(const StoredReference& reference, const calibration::Calibration& calibration,
                    const std::filesystem::path& folder);

/// Nothing when there is none, or one of another calibration or frame size. Throws
/// std::runtime_error naming the file when there is one that cannot be read.
[[nodiscard]] std::optional<StoredReference> load_reference(
    const calibration::Calibration& calibration, int width, int height,
    const std::filesystem::path& folder);

}  // namespace dtact::pipeline
