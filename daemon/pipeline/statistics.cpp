#include "daemon/pipeline/statistics.hpp"

#include <sys/resource.h>

namespace dtact::pipeline {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;

}  // namespace

StageStatistics summarise(const char* stage, const Histogram& times) {
  StageStatistics statistics{stage, static_cast<double>(times.percentile_ns(0.5)) / 1e3,
                             static_cast<double>(times.percentile_ns(0.99)) / 1e3,
                             static_cast<double>(times.max_ns()) / 1e3};
  statistics.sum_us = static_cast<double>(times.sum_ns()) / 1e3;
  statistics.count = times.cumulate(kStageBoundsNs, statistics.within);
  return statistics;
}

void Statistics::add(const StageTimes& times, bool has_depth, std::int64_t ready_ns,
                     std::int64_t done_ns) noexcept {
  histograms_[kDecode].add(times.decode_ns);
  histograms_[kPublish].add(times.publish_ns);
  if (has_depth) {
    histograms_[kActivity].add(times.activity_ns);
    histograms_[kRectify].add(times.rectify_ns);
    histograms_[kSmooth].add(times.smooth_ns);
    histograms_[kLut].add(times.lut_ns);
    histograms_[kInspect].add(times.inspect_ns);
    histograms_[kTotal].add(done_ns - ready_ns);
  }

  if (frames_ == 0) second_began_ns_ = done_ns;
  ++frames_;
  if (const std::int64_t passed = done_ns - second_began_ns_; passed >= kSecond) {
    // frames_ stamps span frames_ − 1 periods.
    fps_.store((frames_ - 1) * 1e9 / static_cast<double>(passed), std::memory_order_relaxed);
    second_began_ns_ = done_ns;
    frames_ = 1;
    take_usage();
  }
  last_ns_.store(done_ns, std::memory_order_relaxed);
}

std::vector<StageStatistics> Statistics::stages() const {
  static constexpr std::array<const char*, kStages> kNames = {
      "decode", "activity", "rectify", "smooth", "lut", "inspect", "publish", "total"};
  std::vector<StageStatistics> all;
  for (std::size_t i = 0; i < kStages; ++i) {
    if (histograms_[i].count() > 0) all.push_back(summarise(kNames[i], histograms_[i]));
  }
  return all;
}

void Statistics::take_usage() noexcept {
  rusage usage{};
  if (::getrusage(RUSAGE_THREAD, &usage) != 0) return;
  const auto store = [](std::atomic<std::uint64_t>& to, long value) {
    to.store(static_cast<std::uint64_t>(value), std::memory_order_relaxed);
  };
  store(minor_faults_, usage.ru_minflt);
  store(major_faults_, usage.ru_majflt);
  store(waits_, usage.ru_nvcsw);
  store(preemptions_, usage.ru_nivcsw);
}

ThreadUsage Statistics::usage() const noexcept {
  return {minor_faults_.load(std::memory_order_relaxed),
          major_faults_.load(std::memory_order_relaxed), waits_.load(std::memory_order_relaxed),
          preemptions_.load(std::memory_order_relaxed)};
}

double Statistics::fps(std::int64_t now_ns) const noexcept {
  const std::int64_t last = last_ns_.load(std::memory_order_relaxed);
  if (last == INT64_MIN || now_ns - last > 2 * kSecond) return 0;
  return fps_.load(std::memory_order_relaxed);
}

}  // namespace dtact::pipeline
