#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>

namespace dtact::fakes {

/// A double of a device's uncached memory. There each load goes to the memory by
/// itself, so that the cost of reading is the number of loads, whatever their width. This memory
/// counts them: it is unreadable, and each load is allowed one instruction at a time.
///
/// On x86-64 only, one object at a time, read by one thread; slow: a few microseconds a load.
class CountedLoads {
 public:
  /// `bytes` at most 64 kB. FilledBuffer with zeros.
  explicit CountedLoads(std::size_t bytes);
  ~CountedLoads();
  CountedLoads(const CountedLoads&) = delete;
  CountedLoads& operator=(const CountedLoads&) = delete;

  /// Readable and writable outside count().
  [[nodiscard]] std::span<std::uint8_t> bytes() const noexcept { return bytes_; }
  /// The loads that `read` makes; nothing where they can't be counted.
  [[nodiscard]] std::optional<std::size_t> count(const std::function<void()>& read) const;

 private:
  std::span<std::uint8_t> bytes_;
};

}  // namespace dtact::fakes
