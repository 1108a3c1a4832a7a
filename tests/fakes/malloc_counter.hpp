#pragma once

#include <cstdint>

namespace dtact::fakes {

/// Counts calls of malloc and its family, free among them, hence of operator new and delete too, on
/// threads that asked for it.
/// A program that links malloc_counter.cpp takes part as a whole; sanitizers bring their own
/// malloc, so there nothing can be counted.
[[nodiscard]] bool can_count_allocations() noexcept;

/// Counting of the calling thread's allocations and frees, on or off. Starts off.
void count_allocations(bool on) noexcept;

/// Allocations and frees counted so far, all threads together.
[[nodiscard]] std::uint64_t counted_allocations() noexcept;

}  // namespace dtact::fakes
