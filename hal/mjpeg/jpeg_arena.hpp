#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <memory>

// clang-format off: jpeglib.h uses FILE and size_t and leaves it to others to declare them.
#include <jpeglib.h>
#include <jerror.h>
// clang-format on

namespace dtact::hal::mjpeg {

/// libjpeg's memory manager, replaced by one that carves from a block taken once. What libjpeg asks
/// for is laid out one after the other and given up as a whole by reset(). Only what a single-scan
/// baseline picture needs is there: whole-image buffers end in libjpeg's error handler, as does an
/// exhausted block.
class JpegArena {
 public:
  explicit JpegArena(std::size_t bytes);

  /// Puts this manager in the place of `cinfo`'s own.
  void attach(jpeg_decompress_struct& cinfo) noexcept;
  /// Gives `cinfo` its own manager back, so that it can be destroyed.
  void detach(jpeg_decompress_struct& cinfo) noexcept;
  /// Forgets all that was carved. No pointer into it may be used afterwards.
  void reset() noexcept { manager_.used = 0; }

 private:
  struct Manager {
    jpeg_memory_mgr functions{};  // first, so that libjpeg's pointer is a pointer to this
    std::uint8_t* block = nullptr;
    std::size_t size = 0;
    std::size_t used = 0;
  };
  static Manager& manager_of(j_common_ptr cinfo) noexcept;
  static void* allocate(j_common_ptr cinfo, int pool, std::size_t bytes);
  static JSAMPARRAY allocate_samples(j_common_ptr cinfo, int pool, JDIMENSION samples,
                                     JDIMENSION rows);
  static JBLOCKARRAY allocate_blocks(j_common_ptr cinfo, int pool, JDIMENSION blocks,
                                     JDIMENSION rows);

  struct Free {
    void operator()(std::uint8_t* bytes) const noexcept;
  };
  std::unique_ptr<std::uint8_t[], Free> block_;
  Manager manager_;
  jpeg_memory_mgr* original_ = nullptr;
};

}  // namespace dtact::hal::mjpeg
