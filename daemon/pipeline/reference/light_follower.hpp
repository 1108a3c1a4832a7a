#pragma once

#include <cstdint>
#include <optional>

#include "daemon/pipeline/pipeline_config.hpp"
#include "daemon/pipeline/reference/cells.hpp"

namespace dtact::pipeline {

/// Follows the light as one factor on the reference. LEDs that warm up or age and an exposure that
/// drifts darken the whole field alike, which no local press does, however faint. It follows what
/// one factor explains completely and, during contact, what one explains of the cells without
/// contact; either after at least kQuietNs. It limits how fast and how far:
///
/// - A slow change is followed up to the rate. After a time when contact hid the light it is
///   followed further, as far as the rate allows for that time, if it was followed before.
/// - A step beyond kStep is not followed, however long it lasts: it may be a flat press of all of
///   the field, which looks the same. Nor is anything beyond the limit. Both set a health flag.
///
/// So it can lose a press that covers the field evenly: kStep (8 µm) at once, and up
/// to the limit (0.1 mm with the default) if it comes more slowly than the rate.
/// tests/accuracy/atlas has the rows. One thread; does not allocate.
class LightFollower {
 public:
  explicit LightFollower(const DriftRules& rules) noexcept;

  /// A new reference is in use: resets the factor to 1. `follows`: false where the factor cannot
  /// be applied; then it only reports.
  void restart(bool follows = true) noexcept;
  /// The next frame that depth is measured in, and when it was taken. Returns the light's factor on
  /// the reference where it has moved by enough to be applied; until the next frame it must be.
  [[nodiscard]] std::optional<double> look(const LightSeen& light,
                                           std::int64_t timestamp_ns) noexcept;

  [[nodiscard]] bool follows() const noexcept { return follows_; }
  /// The factor that is applied.
  [[nodiscard]] double factor() const noexcept { return applied_; }
  /// What of the light is not followed, as last seen: a share of it, positive where it is brighter.
  [[nodiscard]] double left() const noexcept { return left_; }
  /// Expected light change since it was last seen: a share, 0 while it is in sight. The
  /// light moves at most at the rate and up to the limit, and any amount up to that is equally
  /// likely, so this is half of it.
  [[nodiscard]] double unseen() const noexcept;
  /// left() is beyond kReportedDrift and has been for kReportedDriftFrames: depth is off by half a
  /// grey level.
  [[nodiscard]] bool drifted() const noexcept { return drifted_; }

  static constexpr double kStep = 0.0015;  ///< A quarter of a grey level: what activity can see.
  static constexpr double kReportedDrift = 0.003;  ///< Half a grey level, 16 µm.
  static constexpr int kReportedDriftFrames = 3;
  static constexpr std::int64_t kQuietNs = 1'000'000'000;
  /// During contact the light is seen now and then only; it has been lost sight of when it
  /// was not for so long.
  static constexpr std::int64_t kUnseenNs = 3'000'000'000;

 private:
  void set_left(double left) noexcept;

  double rate_;   // share a second
  double limit_;  // share
  bool follows_ = true;
  double applied_ = 1;
  double followed_ = 1;   // target of applied_, in steps that justify the update
  double allowance_ = 0;  // share that the light may have moved while it was not seen
  bool lost_ = false;     // the light last seen is too far from the followed one
  double left_ = 0;
  bool drifted_ = false;
  int disagreeing_ = 0;  // frames in a row that speak against drifted_
  std::optional<std::int64_t> before_ns_;
  LightSeen::From from_ = LightSeen::From::nothing;  // as last seen
  std::int64_t seen_ns_ = 0;                         // when
  std::int64_t quiet_ns_ = 0;                        // seen the same way for so long
  std::int64_t unseen_ns_ = 0;                       // not seen for so long
};

}  // namespace dtact::pipeline
