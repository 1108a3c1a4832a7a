#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "daemon/pipeline/histogram.hpp"
#include "daemon/pipeline/port.hpp"

namespace dtact::pipeline {

/// The percentiles and counts of one stage.
[[nodiscard]] StageStatistics summarise(const char* stage, const Histogram& times);

/// Durations of each stage, frame rate, and the kernel's resource usage of the thread that calls
/// add(). One thread adds, any thread reads.
class Statistics {
 public:
  /// A frame's stages, and from the payload's arrival to its publication. Once a second it also
  /// asks the kernel about the calling thread (a microsecond).
  void add(const StageTimes& times, bool has_depth, std::int64_t ready_ns,
           std::int64_t done_ns) noexcept;

  [[nodiscard]] std::vector<StageStatistics> stages() const;
  /// Frames a second over the last whole second; 0 once none came for two seconds.
  [[nodiscard]] double fps(std::int64_t now_ns) const noexcept;
  /// Usage of the thread that calls add(), as of the last whole second.
  [[nodiscard]] ThreadUsage usage() const noexcept;

 private:
  void take_usage() noexcept;

  enum Stage : std::size_t {
    kDecode,
    kActivity,
    kRectify,
    kSmooth,
    kLut,
    kInspect,
    kPublish,
    kTotal,
    kStages
  };
  std::array<Histogram, kStages> histograms_;

  std::int64_t second_began_ns_ = 0;
  int frames_ = 0;
  std::atomic<double> fps_{0};
  std::atomic<std::int64_t> last_ns_{INT64_MIN};
  std::atomic<std::uint64_t> minor_faults_{0};
  std::atomic<std::uint64_t> major_faults_{0};
  std::atomic<std::uint64_t> waits_{0};
  std::atomic<std::uint64_t> preemptions_{0};
};

}  // namespace dtact::pipeline
