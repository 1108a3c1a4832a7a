#include "daemon/pipeline/histogram.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

namespace dtact::pipeline {

std::size_t Histogram::bucket_of(std::uint64_t ns) noexcept {
  // Below 64 every value has a bucket; above, the upper six bits name it.
  const int shift = std::max(0, static_cast<int>(std::bit_width(ns)) - kSubBits - 1);
  return (static_cast<std::size_t>(shift) << kSubBits) + (ns >> static_cast<unsigned>(shift));
}

std::int64_t Histogram::upper_end(std::size_t bucket) noexcept {
  constexpr std::size_t kFirst = std::size_t{2} << kSubBits;
  if (bucket < kFirst) return static_cast<std::int64_t>(bucket);
  const std::size_t shift = (bucket >> kSubBits) - 1;
  const std::size_t lead = bucket - (shift << kSubBits);
  return static_cast<std::int64_t>(((lead + 1) << shift) - 1);
}

void Histogram::add(std::int64_t ns) noexcept {
  constexpr std::int64_t kLargest = (std::int64_t{1} << kMaxBits) - 1;
  const std::int64_t value = std::clamp<std::int64_t>(ns, 0, kLargest);
  auto& count = counts_[bucket_of(static_cast<std::uint64_t>(value))];
  // One thread adds, so no read-modify-write is needed.
  count.store(count.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
  sum_.store(sum_.load(std::memory_order_relaxed) + value, std::memory_order_relaxed);
  if (value > max_.load(std::memory_order_relaxed)) max_.store(value, std::memory_order_relaxed);
}

std::uint64_t Histogram::count() const noexcept {
  std::uint64_t sum = 0;
  for (const auto& count : counts_) sum += count.load(std::memory_order_relaxed);
  return sum;
}

std::uint64_t Histogram::cumulate(std::span<const std::int64_t> bounds_ns,
                                  std::span<std::uint64_t> counts) const noexcept {
  std::uint64_t seen = 0;
  std::size_t bound = 0;
  for (std::size_t i = 0; i < kBuckets; ++i) {
    for (; bound < bounds_ns.size() && upper_end(i) > bounds_ns[bound]; ++bound) {
      counts[bound] = seen;
    }
    seen += counts_[i].load(std::memory_order_relaxed);
  }
  for (; bound < bounds_ns.size(); ++bound) counts[bound] = seen;
  return seen;
}

std::int64_t Histogram::percentile_ns(double share) const noexcept {
  const std::uint64_t all = count();
  if (all == 0) return 0;
  const double wanted = std::ceil(share * static_cast<double>(all));
  const auto rank = std::max<std::uint64_t>(1, static_cast<std::uint64_t>(wanted));
  std::uint64_t seen = 0;
  for (std::size_t i = 0; i < kBuckets; ++i) {
    seen += counts_[i].load(std::memory_order_relaxed);
    if (seen >= rank) return std::min(upper_end(i), max_ns());
  }
  return max_ns();
}

}  // namespace dtact::pipeline
