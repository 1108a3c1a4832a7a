#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "daemon/pipeline/histogram.hpp"
#include "daemon/pipeline/port.hpp"

namespace dtact::pipeline {

/// How long each stage takes, and how fast frames come. One thread adds, any thread reads.
class Statistics {
 public:
  /// A frame's stages, and from the payload's arrival to its publication.
  void add(const StageTimes& times, bool has_depth, std::int64_t ready_ns,
           std::int64_t done_ns) noexcept;

  [[nodiscard]] std::vector<StageStatistics> stages() const;
  /// Frames a second over the last whole second; 0 once none came for two seconds.
  [[nodiscard]] double fps(std::int64_t now_ns) const noexcept;

 private:
  enum Stage : std::size_t { kDecode, kRectify, kSmooth, kList, kInspect, kTotal, kStages };
  std::array<Histogram, kStages> histograms_;

  std::int64_t second_began_ns_ = 0;
  int frames_ = 0;
  std::atomic<double> fps_{0};
  std::atomic<std::int64_t> last_ns_{INT64_MIN};
};

}  // namespace dtact::pipeline
