#pragma once

#include <cstddef>

namespace dtact::metrics {

/// What the C library's allocator holds, over all of its arenas, bytes. A leak makes `used` grow;
/// memory that is only kept or in pieces is `free`.
struct Heap {
  std::size_t used = 0;    ///< Blocks in use, those that were mapped one by one included.
  std::size_t free = 0;    ///< Kept for later blocks, whether its pages are resident or not.
  std::size_t mapped = 0;  ///< Of `used`, blocks mapped one by one: the large ones.
};

/// By mallinfo2(3). Holds each arena's lock while its free blocks are counted. Under sanitizers,
/// which bring an allocator of their own, it says nothing of the program.
[[nodiscard]] Heap heap() noexcept;

}  // namespace dtact::metrics
