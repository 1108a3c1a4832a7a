#pragma once

#include <array>
#include <cstddef>

#include "daemon/pipeline/pipeline_config.hpp"

namespace dtact::pipeline {

/// Says when the mean grey has stopped moving: over the last `settle_frames` frames it stayed
/// within `settle_grey` grey levels.
class SettleDetector {
 public:
  /// Throws std::invalid_argument when settle_frames is not 2 … 64.
  explicit SettleDetector(const ReferenceRules& rules);

  void reset() noexcept { count_ = 0; }
  /// Takes the next frame's mean; true once settled.
  [[nodiscard]] bool add(float mean_grey) noexcept;

 private:
  static constexpr std::size_t kMost = 64;
  std::size_t frames_;
  double grey_;
  std::array<float, kMost> means_{};
  std::size_t count_ = 0;
};

}  // namespace dtact::pipeline
