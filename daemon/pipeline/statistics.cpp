#include "daemon/pipeline/statistics.hpp"

namespace dtact::pipeline {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;

}  // namespace

void Statistics::add(const StageTimes& times, bool has_depth, std::int64_t ready_ns,
                     std::int64_t done_ns) noexcept {
  histograms_[kDecode].add(times.decode_ns);
  if (has_depth) {
    histograms_[kRectify].add(times.rectify_ns);
    histograms_[kSmooth].add(times.smooth_ns);
    histograms_[kList].add(times.list_ns);
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
  }
  last_ns_.store(done_ns, std::memory_order_relaxed);
}

std::vector<StageStatistics> Statistics::stages() const {
  static constexpr std::array<const char*, kStages> kNames = {"decode", "rectify", "smooth",
                                                              "list",   "inspect", "total"};
  std::vector<StageStatistics> all;
  for (std::size_t i = 0; i < kStages; ++i) {
    const Histogram& h = histograms_[i];
    if (h.count() == 0) continue;
    all.push_back({kNames[i], static_cast<double>(h.percentile_ns(0.5)) / 1e3,
                   static_cast<double>(h.percentile_ns(0.99)) / 1e3,
                   static_cast<double>(h.max_ns()) / 1e3});
  }
  return all;
}

double Statistics::fps(std::int64_t now_ns) const noexcept {
  const std::int64_t last = last_ns_.load(std::memory_order_relaxed);
  if (last == INT64_MIN || now_ns - last > 2 * kSecond) return 0;
  return fps_.load(std::memory_order_relaxed);
}

}  // namespace dtact::pipeline
