#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <utility>

namespace dtact::pipeline {

/// Bounded queue from one producing thread to one consuming thread, without locks or allocation of
/// its own. Overflow policy: push() refuses and leaves the value with the caller, who keeps it and
/// tries again; nothing is ever dropped here.
template <typename T, std::size_t kCapacity>
class SpscQueue {  // NOLINT(clang-analyzer-optin.performance.Padding): a cache line each
 public:
  static_assert(kCapacity > 0 && (kCapacity & (kCapacity - 1)) == 0, "a power of two");

  SpscQueue() = default;
  SpscQueue(const SpscQueue&) = delete;
  SpscQueue& operator=(const SpscQueue&) = delete;

  /// Producer: false when full; `value`, a T or what can be assigned to one, is moved from only
  /// when true.
  template <typename Value = T>
  [[nodiscard]] bool push(Value&& value) noexcept(std::is_nothrow_assignable_v<T&, Value&&>) {
    const std::size_t tail = tail_.load(std::memory_order_relaxed);
    if (tail - head_.load(std::memory_order_acquire) == kCapacity) return false;
    slots_[tail % kCapacity] = std::forward<Value>(value);
    tail_.store(tail + 1, std::memory_order_release);
    return true;
  }

  /// Producer: places left; never fewer than that until the next push().
  [[nodiscard]] std::size_t room() const noexcept {
    return kCapacity -
           (tail_.load(std::memory_order_relaxed) - head_.load(std::memory_order_acquire));
  }

  /// Consumer: false when empty. The slot keeps no resources of what was popped.
  [[nodiscard]] bool pop(T& out) noexcept(std::is_nothrow_move_assignable_v<T>) {
    const std::size_t head = head_.load(std::memory_order_relaxed);
    if (head == tail_.load(std::memory_order_acquire)) return false;
    out = std::exchange(slots_[head % kCapacity], T{});
    head_.store(head + 1, std::memory_order_release);
    return true;
  }

 private:
  std::array<T, kCapacity> slots_{};
  // Counts of all pushes and pops ever; their difference is the fill, whatever wraps.
  alignas(64) std::atomic<std::size_t> tail_{0};
  alignas(64) std::atomic<std::size_t> head_{0};
};

}  // namespace dtact::pipeline
