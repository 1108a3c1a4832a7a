#pragma once

#include <cstdint>

namespace dtact::fakes {

/// Counts calls of malloc and its family, including free, and so of operator new and delete, on
/// threads that switch it on.
/// It needs malloc_counter.cpp in the program; sanitizers bring their own
/// malloc, so nothing can be counted there.
[[nodiscard]] bool can_count_allocations() noexcept;

/// Counting of the calling thread's allocations and frees, on or off. Starts off.
void count_allocations(bool on) noexcept;

/// Allocations and frees counted so far, all threads together.
[[nodiscard]] std::uint64_t counted_allocations() noexcept;

}  // namespace dtact::fakes
