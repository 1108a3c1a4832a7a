#include "hal/libcamera/dma_buffer.hpp"

#include <fcntl.h>
#include <libcamera/formats.h>
#include <linux/dma-buf.h>
#include <linux/dma-heap.h>
#include <sys/ioctl.h>
#include <sys/mman.h>

#include <cerrno>
#include <system_error>
#include <utility>

namespace dtact::hal::libcamera_backend {

namespace lc = libcamera;

DmaHeap::DmaHeap(std::span<const char* const> nodes) {
  for (const char* node : nodes) {
    fd_.reset(::open(node, O_RDWR | O_CLOEXEC));
    if (fd_) return;
  }
}

base::UniqueFd DmaHeap::allocate(std::size_t bytes) const noexcept {
  dma_heap_allocation_data wanted{};
  wanted.len = bytes;
  wanted.fd_flags = O_RDWR | O_CLOEXEC;
  if (!fd_ || ::ioctl(fd_.get(), DMA_HEAP_IOCTL_ALLOC, &wanted) != 0) return {};
  return base::UniqueFd(static_cast<int>(wanted.fd));
}

Mapping::Mapping(int fd, std::size_t bytes) {
  void* memory = ::mmap(nullptr, bytes, PROT_READ, MAP_SHARED, fd, 0);
  if (memory == MAP_FAILED) throw std::system_error(errno, std::generic_category(), "mmap");
  bytes_ = {static_cast<const std::uint8_t*>(memory), bytes};
}

Mapping::Mapping(Mapping&& other) noexcept : bytes_(std::exchange(other.bytes_, {})) {}

Mapping& Mapping::operator=(Mapping&& other) noexcept {
  std::swap(bytes_, other.bytes_);
  return *this;
}

Mapping::~Mapping() {
  if (bytes_.empty()) return;
  ::munmap(const_cast<std::uint8_t*>(bytes_.data()), bytes_.size());
}

bool sync_for_reading(int fd, bool begin) noexcept {
  dma_buf_sync sync{};
  sync.flags = DMA_BUF_SYNC_READ | (begin ? DMA_BUF_SYNC_START : DMA_BUF_SYNC_END);
  while (::ioctl(fd, DMA_BUF_IOCTL_SYNC, &sync) != 0) {
    // "restart the call" after these two: linux/dma-buf's documentation of CPU access.
    if (errno != EINTR && errno != EAGAIN) return errno == ENOTTY;
  }
  return true;
}

std::vector<PlaneExtent> planes_of(const lc::PixelFormat& format, unsigned stride, unsigned height,
                                   unsigned bytes) {
  const unsigned luma = stride * height;
  if (format == lc::formats::NV12) return {{0, luma}, {luma, bytes - luma}};
  if (format == lc::formats::YUV420) {
    const unsigned chroma = (stride / 2) * (height / 2);
    return {{0, luma}, {luma, chroma}, {luma + chroma, bytes - luma - chroma}};
  }
  return {{0, bytes}};
}

std::vector<std::unique_ptr<lc::FrameBuffer>> make_frame_buffers(
    const DmaHeap& heap, const lc::StreamConfiguration& stream) {
  const std::vector<PlaneExtent> extents =
      planes_of(stream.pixelFormat, stream.stride, stream.size.height, stream.frameSize);
  std::vector<std::unique_ptr<lc::FrameBuffer>> buffers;
  for (unsigned i = 0; i < stream.bufferCount; ++i) {
    base::UniqueFd fd = heap.allocate(stream.frameSize);
    if (!fd) return {};
    const lc::SharedFD shared(fd.release());
    std::vector<lc::FrameBuffer::Plane> planes;
    for (const PlaneExtent& extent : extents) {
      lc::FrameBuffer::Plane plane;
      plane.fd = shared;
      plane.offset = extent.offset;
      plane.length = extent.length;
      planes.push_back(std::move(plane));
    }
    buffers.push_back(std::make_unique<lc::FrameBuffer>(planes));
  }
  return buffers;
}

}  // namespace dtact::hal::libcamera_backend
