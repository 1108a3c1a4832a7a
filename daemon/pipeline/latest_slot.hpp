#pragma once

#include <array>
#include <atomic>
#include <cstdint>

namespace dtact::pipeline {

/// Hand-over of the newest result from one writing thread to one reading thread, without locks and
/// without copies. A pool of exactly three: one being written, one waiting, one held by the reader.
/// Overflow policy: the newest wins; a waiting one that is replaced is counted.
template <typename T>
class LatestSlot {  // NOLINT(clang-analyzer-optin.performance.Padding): see the fields
 public:
  /// All three start as copies of `prototype`, with its buffers' sizes.
  explicit LatestSlot(const T& prototype) : pool_{prototype, prototype, prototype} {}
  LatestSlot(const LatestSlot&) = delete;
  LatestSlot& operator=(const LatestSlot&) = delete;

  /// Writer: the one to fill. The same object until publish().
  [[nodiscard]] T& back() noexcept { return pool_[back_]; }

  /// Writer: publishes back() as the newest.
  void publish() noexcept {
    // Release: the reader that takes this index sees what was written. Acquire: what the reader
    // read from the buffer that comes back is over.
    const std::uint8_t old =
        waiting_.exchange(static_cast<std::uint8_t>(back_ | kFresh), std::memory_order_acq_rel);
    back_ = old & kIndex;
    if ((old & kFresh) != 0) replaced_.store(replaced() + 1, std::memory_order_relaxed);
  }

  /// Reader: the newest that was not fetched yet, or null. Valid until a later
  /// call returns another.
  [[nodiscard]] const T* fetch() noexcept {
    if ((waiting_.load(std::memory_order_relaxed) & kFresh) == 0) return nullptr;
    const std::uint8_t old = waiting_.exchange(front_, std::memory_order_acq_rel);
    front_ = old & kIndex;
    return &pool_[front_];
  }

  /// Any thread: how many were replaced before they were fetched.
  [[nodiscard]] std::uint64_t replaced() const noexcept {
    return replaced_.load(std::memory_order_relaxed);
  }

 private:
  static constexpr std::uint8_t kIndex = 3;
  static constexpr std::uint8_t kFresh = 4;

  // What both threads write, what the writer and what the reader uses: a cache line each.
  alignas(64) std::atomic<std::uint8_t> waiting_{1};  // an index, with kFresh until it is fetched
  alignas(64) std::uint8_t back_ = 0;
  std::atomic<std::uint64_t> replaced_{0};
  std::array<T, 3> pool_;
  alignas(64) std::uint8_t front_ = 2;
};

}  // namespace dtact::pipeline
