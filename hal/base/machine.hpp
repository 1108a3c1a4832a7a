#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

namespace dtact::base {

/// What the C library's allocator holds, over all of its arenas, bytes. A leak makes `used` grow;
/// memory that is only kept or in pieces is `free`.
struct Heap {
  std::size_t used = 0;    ///< Blocks in use, those that were mapped one by one included.
  std::size_t free = 0;    ///< Kept for later blocks, whether its pages are resident or not.
  std::size_t mapped = 0;  ///< the large blocks, mapped one by one; part of `used`
};

/// By mallinfo2(3). Holds each arena's lock while its free blocks are counted. Under sanitizers,
/// which bring an allocator of their own, it says nothing of the program.
[[nodiscard]] Heap heap() noexcept;

/// One of the board's own thermometers.
struct Temperature {
  std::string zone;  ///< "thermal_zone0"
  std::string type;  ///< "cpu-thermal", as the kernel's driver calls it
  double celsius = 0;
};

/// What the kernel's thermal zones read now, in the order of their names; those that do not answer
/// are left out. Some take long to read, as a firmware answers. `folder`: as in the kernel's
/// Documentation/ABI/testing/sysfs-class-thermal.
[[nodiscard]] std::vector<Temperature> temperatures(
    const std::filesystem::path& folder = "/sys/class/thermal");

}  // namespace dtact::base
