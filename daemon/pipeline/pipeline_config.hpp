#pragma once

#include <algorithm>
#include <array>
#include <filesystem>
#include <optional>
#include <utility>

#include "hal/light_ring.hpp"

namespace dtact::pipeline {

/// When a depth map counts as contact.
struct ContactRules {
  double threshold_mm = 0.10;  ///< Contact is made where indentation exceeds this, millimetres, …
  double release_mm =
      0.05;                 ///< … and lost once it exceeds only this no longer. Below threshold_mm.
  double area_mm2 = 0.5;    ///< On at least this much surface, square millimetres.
  int debounce_frames = 2;  ///< For this many frames in a row.
};

/// At which share of the calibration's resolution depth is reconstructed.
struct ReconstructionRules {
  static constexpr int kAutoSharpen = -1;
  static constexpr double kMinErrorUm = 1;
  static constexpr double kMaxErrorUm = 10000;

  /// 1, 2 or 4: a pixel of the map is the mean over this number of the calibration's pixels each
  /// way. 0: for every frame the coarsest whose expected error stays within max_error_um.
  int decimation = 1;
  /// Steps of the filter that sharpens against scattering (recon/sharpener.hpp): 0 … 2, or
  /// kAutoSharpen: for every frame the fewest whose expected error stays within max_error_um, all
  /// at recon::kSharpenedAt and interpolated to `decimation` (0: left so); as 0 where the
  /// calibration has none (recon::sharpening_steps()).
  int sharpen = 0;
  double max_error_um = 50;  ///< kMinErrorUm … kMaxErrorUm, micrometres.

  bool operator==(const ReconstructionRules&) const = default;
};

/// What ReconstructionRules::decimation and sharpen are called, but for 1 and 2 steps.
inline constexpr std::array<std::pair<const char*, int>, 4> kResolutionNames{
    {{"full", 1}, {"half", 2}, {"quarter", 4}, {"auto", 0}}};
inline constexpr std::array<std::pair<const char*, int>, 2> kSharpenNames{
    {{"off", 0}, {"auto", ReconstructionRules::kAutoSharpen}}};

/// How far the reference follows the light as a whole (light_follower.hpp).
struct DriftRules {
  double limit_percent = 2;       ///< At most so far from the reference as it was taken; 0 = never.
  double percent_per_minute = 2;  ///< At most so fast.
};

/// How the reference image is taken.
struct ReferenceRules {
  int frames = 32;            ///< Averaged into one reference, 1 … 256.
  int settle_frames = 8;      ///< The mean grey has settled when over this many frames, 2 … 64, …
  double settle_grey = 0.25;  ///< … it moves by less than this many grey levels.
  int timeout_frames = 300;   ///< A picture that is not still by then counts as in contact.

  /// The longest time that a re-zero takes, seconds, with a camera whose mode promises `mode_fps`
  /// and that gives `measured_fps` (0: not known). The picture may settle for timeout_frames and be
  /// averaged for as long again; without frames the re-zero is refused after a second, or three
  /// frames.
  [[nodiscard]] double rezero_timeout_s(double mode_fps, double measured_fps) const noexcept {
    const double fps = measured_fps > 0 ? std::min(measured_fps, mode_fps) : mode_fps;
    return std::max(1.0, 3 / fps) + 2 * timeout_frames / fps;
  }
};

/// Settings of the capture thread and what it decides. Does not change while it runs.
struct PipelineConfig {
  std::optional<int> cpu;   ///< Pin the capture thread to this CPU; empty = not pinned.
  int fifo_priority = 40;   ///< SCHED_FIFO 1 … 99; 0 = normal scheduling.
  bool lock_memory = true;  ///< Keep the process's memory out of swap.
  hal::Light light;         ///< What the ring shows at start.
  /// As CameraInfo::light_delay_frames, measured; empty = what the camera states.
  std::optional<int> light_delay_frames;
  ContactRules contact;
  ReferenceRules reference;
  DriftRules drift;
  ReconstructionRules reconstruction;
  /// More of the calibration's pixels than this beyond the list: Health::beyond_calibration.
  int beyond_pixels = 64;
  std::filesystem::path state_folder;  ///< Keeps the last good reference; empty = not kept.
  /// Why another calibration than the current one, or none, is used since the start, and what to
  /// do.
  std::string calibration_note;
};

}  // namespace dtact::pipeline
