#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>

namespace dtact::fakes {

/// Memory that stands in for a device's without caches: there each load goes to the memory by
/// itself, so that what reading costs is the number of loads, whatever their width. This memory
/// counts them: it is unreadable, and each load is let through one instruction at a time.
///
/// On x86-64 alone, one such memory at a time, read by one thread; slow: a few microseconds a load.
class CountedLoads {
 public:
  /// `bytes` at most 64 kB. FilledBuffer with zeros.
  explicit CountedLoads(std::size_t bytes);
  ~CountedLoads();
  CountedLoads(const CountedLoads&) = delete;
  CountedLoads& operator=(const CountedLoads&) = delete;

  /// Readable and writable outside count().
  [[nodiscard]] std::span<std::uint8_t> bytes() const noexcept { return bytes_; }
  /// The loads that `read` makes; none where they can't be counted.
  [[nodiscard]] std::optional<std::size_t> count(const std::function<void()>& read) const;

 private:
  std::span<std::uint8_t> bytes_;
};

}  // namespace dtact::fakes
