#pragma once

#include <fmt/format.h>

#include <cstddef>
#include <string>
#include <vector>

#include "daemon/calibration/calibration.hpp"
#include "daemon/recon/flat_field_gain.hpp"
#include "daemon/recon/force.hpp"
#include "daemon/recon/surface.hpp"
#include "hal/files/key_reader.hpp"

namespace dtact::calibration {

/// A TOML array, broken into lines that an editor can show.
template <typename Value>
std::string array_text(const std::vector<Value>& values) {
  constexpr std::size_t kPerLine = 16;
  std::string out = "[";
  for (std::size_t i = 0; i < values.size(); ++i) {
    out += i % kPerLine == 0 ? "\n  " : " ";
    out += fmt::format("{},", values[i]);
  }
  return out + "\n]";
}

/// A calibration's `[force]` table, which those without a force do not have.
[[nodiscard]] std::string format_force(const recon::ForceModel& force);
/// Takes its keys. Throws as KeyReader.
[[nodiscard]] recon::ForceModel read_force(tomlfile::KeyReader reader);

/// A `[gain]` table of a calibration (places from the map's centre) or a lens file (places of the
/// lens's millimetres).
[[nodiscard]] std::string format_gain(const recon::FlatFieldGain& gain);

/// Takes a `[gain]` table's keys; an empty table is no gain, as in files from before there were
/// gains. Throws as KeyReader.
[[nodiscard]] recon::FlatFieldGain read_gain(tomlfile::KeyReader reader);

/// The `[gel]` table.
[[nodiscard]] std::string format_gel(const GelEstimate& gel);
/// Throws as KeyReader.
[[nodiscard]] GelEstimate read_gel(tomlfile::KeyReader reader);

/// A `[viewpoint]` table of a calibration or a lens file, with its header; empty where the height
/// is unknown.
[[nodiscard]] std::string format_view(const CameraView& view);
/// Takes its keys. Throws as KeyReader.
[[nodiscard]] CameraView read_view(tomlfile::KeyReader reader);

/// A `[surface]` table of a calibration; empty for a plane.
[[nodiscard]] std::string format_surface(const recon::Surface& surface);

/// Takes a `[surface]` table's keys. Throws as KeyReader.
[[nodiscard]] recon::Surface read_surface(tomlfile::KeyReader reader);

}  // namespace dtact::calibration
