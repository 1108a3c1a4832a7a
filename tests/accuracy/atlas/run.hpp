#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "daemon/pipeline/health.hpp"
#include "hal/sim/truth.hpp"
#include "tests/accuracy/atlas/disturbance.hpp"
#include "tests/accuracy/atlas/methods.hpp"

namespace dtact::atlas {

/// One run of the daemon's capture loop with the simulated camera, in its own time.
struct Script {
  std::shared_ptr<const hal::sim::Truth> truth;
  int frames = 0;                 ///< Frames of the camera, including damaged ones.
  double fps = 60;                ///< A low rate makes minutes pass in few frames.
  bool follow = true;             ///< The reference follows the light, as configured by default.
  int judged = 12;                ///< Number of last frames judged.
  std::optional<int> rezero;      ///< The frame before which a re-zero is requested.
  bool force = true;              ///< Forced, since a darkened field looks like contact.
  std::function<Shot(int)> shot;  ///< The shot of frame n.
  /// The moment whose indentation is true at frame n, where it is not the shown one.
  std::function<std::uint64_t(int)> moment;
};

/// The frames from start-up until the reference is taken: settling (8) and averaging (16).
inline constexpr int kReady = 30;

/// Result of a run's judged frames.
struct Outcome {
  double inside_mm = 0;   ///< Mean absolute error in contact; NaN: no depth there.
  double outside_mm = 0;  ///< The same elsewhere.
  /// Like error_mm(), but the truth is moved along with a picture that the camera's shift moves:
  /// the rest is wrong in depth, not in place. NaN where the camera did not move.
  double along_mm = std::numeric_limits<double>::quiet_NaN();
  double withheld = 0;   ///< Share of the frames without depth, or of the contact marked untrusted.
  double flagged = 0;    ///< Share of the frames that carried a health flag.
  double stated_mm = 0;  ///< Mean uncertainty of the frames with depth.
  std::array<int, pipeline::kHealthCount> health_flags{};  ///< Frames that carried each.
  int frames = 0;

  /// The larger of the two errors; NaN when there was no depth at all.
  [[nodiscard]] double error_mm() const noexcept;
  /// At least half of the frames carried a health flag or had no depth.
  [[nodiscard]] bool reported() const noexcept { return flagged >= 0.5 || withheld >= 0.5; }
};

/// Runs the loop on this thread: the camera's clock is the only one, so a minute takes seconds and
/// the same script gives the same outcome. Without real-time settings, state folder or ring.
[[nodiscard]] Outcome run(const Method& method, const Script& script);

/// Names of the health flags that at least a tenth of the frames carried, comma separated.
[[nodiscard]] std::string health_flags_of(const Outcome& outcome);

}  // namespace dtact::atlas
