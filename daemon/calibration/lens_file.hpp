#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "daemon/recon/lens.hpp"
#include "daemon/recon/spatial_gain.hpp"
#include "hal/files/key_reader.hpp"

namespace dtact::calibration {

/// A lens and the camera frame it was measured in, and what the same images told of the gain: what
/// `dtactctl calibrate lens` writes.
struct LensFile {
  int frame_width = 0;
  int frame_height = 0;
  recon::Lens lens;
  recon::SpatialGain gain;         ///< Places in millimetres of the lens's surface.
  std::vector<std::string> notes;  ///< Comment lines: how it was measured and how well it fits.
  bool gain_told = false;          ///< A board said so, also where `gain` is none.
};

/// The keys of a `[lens]` table, one a line, without the header. Numbers are read back exactly.
[[nodiscard]] std::string format_lens(const recon::Lens& lens);

/// Takes a `[lens]` table's keys; an empty table is no lens. Throws as KeyReader.
[[nodiscard]] std::optional<recon::Lens> read_lens(tomlfile::KeyReader reader, int frame_width,
                                                   int frame_height);

/// The text of a lens file.
[[nodiscard]] std::string format(const LensFile& file);

/// Reads a lens file, or the lens of a calibration folder (without its gain, which belongs to its
/// list). Throws std::runtime_error with file,
/// line, key and remedy.
[[nodiscard]] LensFile load_lens(const std::filesystem::path& path);

}  // namespace dtact::calibration
