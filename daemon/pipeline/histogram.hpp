#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>

namespace dtact::pipeline {

/// Counts of durations in buckets whose width is 1/32 of their octave (the layout of
/// HdrHistogram), so a percentile is at most 3.2 % high. Fixed size; one thread adds, any thread
/// reads.
class Histogram {
 public:
  /// Negative counts as 0, more than 18 minutes (2⁴⁰ ns) as that.
  void add(std::int64_t ns) noexcept;

  [[nodiscard]] std::uint64_t count() const noexcept;
  /// Upper end of the bucket below which `share` (0 … 1) of all values lie, but at most the
  /// greatest value; 0 while empty.
  [[nodiscard]] std::int64_t percentile_ns(double share) const noexcept;
  [[nodiscard]] std::int64_t max_ns() const noexcept {
    return max_.load(std::memory_order_relaxed);
  }
  [[nodiscard]] std::int64_t sum_ns() const noexcept {
    return sum_.load(std::memory_order_relaxed);
  }
  /// How many values are at most each of the ascending `bounds_ns`, into `counts` of the same
  /// length. A bucket that a bound cuts counts above it, so a count is that of a bound at most 3.2
  /// % lower. Returns the count of all.
  [[nodiscard]] std::uint64_t cumulate(std::span<const std::int64_t> bounds_ns,
                                       std::span<std::uint64_t> counts) const noexcept;

 private:
  static constexpr int kSubBits = 5;
  static constexpr int kMaxBits = 40;
  static constexpr std::size_t kBuckets = std::size_t{kMaxBits - kSubBits + 1} << kSubBits;

  static std::size_t bucket_of(std::uint64_t ns) noexcept;
  static std::int64_t upper_end(std::size_t bucket) noexcept;

  std::array<std::atomic<std::uint64_t>, kBuckets> counts_{};
  std::atomic<std::int64_t> max_{0};
  std::atomic<std::int64_t> sum_{0};
};

}  // namespace dtact::pipeline
