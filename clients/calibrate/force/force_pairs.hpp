#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "clients/calibrate/force/force_fit.hpp"
#include "daemon/calibration/calibration.hpp"
#include "hal/files/png.hpp"

namespace dtact::force {

/// The user's input: frames, and the scale's reading while they were taken.
struct Reading {
  std::string frames;  ///< A PNG file, a folder of them, or a recording: press.mcap[:frame[:end]].
  double value = 0;    ///< The scale's reading.
};

/// "FRAMES@VALUE". Throws std::runtime_error.
[[nodiscard]] Reading parse_reading(const std::string& text);

/// Reads a CSV file of two columns with the heading `frames,force`. Frames are relative to its
/// folder; empty lines and those that begin with # are skipped. Throws std::runtime_error with file
/// and line.
[[nodiscard]] std::vector<Reading> read_readings(const std::filesystem::path& csv);

/// The contacts of frames, averaged over each reading's frames.
class ContactReader {
 public:
  /// Pictures are measured against `reference_q8`, the reference image in their light. Errors name
  /// `folder`, the path that the calibration was loaded from.
  ContactReader(const calibration::Calibration& calibration,
                std::span<const std::uint16_t> reference_q8, std::string folder)
      : calibration_(calibration), reference_q8_(reference_q8), folder_(std::move(folder)) {}

  /// The reading itself is left to the caller. A recording's maps are those that the daemon
  /// measured. Throws std::runtime_error when the frames cannot be read, are of another size or,
  /// recorded, of another calibration, or reach deeper than the calibration covers.
  [[nodiscard]] Pair measure(const std::string& frames) const;
  /// The same for pictures in memory.
  [[nodiscard]] Pair measure(std::span<const image::Grey8> frames, const std::string& name) const;

 private:
  [[nodiscard]] Pair measure_recording(const std::string& path, std::uint64_t first,
                                       std::uint64_t end) const;

  const calibration::Calibration& calibration_;
  std::span<const std::uint16_t> reference_q8_;
  std::string folder_;
};

}  // namespace dtact::force
