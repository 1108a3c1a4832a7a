#pragma once

#include <libcamera/framebuffer.h>
#include <libcamera/stream.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "hal/base/unique_fd.hpp"

namespace dtact::hal::libcamera_backend {

/// The heaps whose memory is read through the processor's caches, best first, as in rpicam-apps
/// (core/dma_heaps.cpp): a link to the system's heap on a Pi 5 and to contiguous memory before, and
/// contiguous memory by its own name. A Pi's drivers give buffers without caches, and the processor
/// reads those byte by byte up to thirty times slower (raspberrypi/linux#5286).
inline constexpr std::array kCachedHeaps{"/dev/dma_heap/vidbuf_cached", "/dev/dma_heap/linux,cma"};

/// The kernel's allocator of memory that devices can write.
class DmaHeap {
 public:
  /// Opens the first of `nodes` that can be; none: a heap that has nothing to give.
  explicit DmaHeap(std::span<const char* const> nodes = kCachedHeaps);
  /// A buffer of at least that many bytes, as a descriptor; empty when there is none.
  [[nodiscard]] base::UniqueFd allocate(std::size_t bytes) const noexcept;

 private:
  base::UniqueFd fd_;
};

/// A buffer in this process's address space, for reading.
class Mapping {
 public:
  Mapping() = default;
  /// Throws std::system_error.
  Mapping(int fd, std::size_t bytes);
  Mapping(Mapping&& other) noexcept;
  Mapping& operator=(Mapping&& other) noexcept;
  Mapping(const Mapping&) = delete;
  Mapping& operator=(const Mapping&) = delete;
  ~Mapping();
  [[nodiscard]] std::span<const std::uint8_t> bytes() const noexcept { return bytes_; }

 private:
  std::span<const std::uint8_t> bytes_;
};

/// Synchronises the caches before (`begin`) or after the processor reads a buffer that a device
/// writes. False: a read may return old data from the caches. No effect on memory that is no DMA
/// buffer.
[[nodiscard]] bool sync_for_reading(int fd, bool begin) noexcept;

/// Where a plane lies within one buffer.
struct PlaneExtent {
  unsigned offset = 0;  ///< Bytes.
  unsigned length = 0;  ///< Bytes.
  bool operator==(const PlaneExtent&) const = default;
};

/// The planes of an image of `bytes` bytes whose luma lines are `stride` apart, one after the
/// other; the last has what remains.
[[nodiscard]] std::vector<PlaneExtent> planes_of(const libcamera::PixelFormat& format,
                                                 unsigned stride, unsigned height, unsigned bytes);

/// Allocates from `heap` the number of buffers that `stream` needs; empty when that fails.
[[nodiscard]] std::vector<std::unique_ptr<libcamera::FrameBuffer>> make_frame_buffers(
    const DmaHeap& heap, const libcamera::StreamConfiguration& stream);

}  // namespace dtact::hal::libcamera_backend
