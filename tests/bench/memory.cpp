// bench_memory: time to read one 800x600 picture from each kind of memory on this machine: its
// own, that of the DMA heaps, and that of a bare sensor's driver (a
// Raspberry Pi's CSI camera, without caches). The median of many readings in microseconds: byte by
// byte, and with hal/luma for full and limited range.
#include <fmt/format.h>
#include <libcamera/camera_manager.h>
#include <libcamera/framebuffer_allocator.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <exception>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "hal/base/clock.hpp"
#include "hal/libcamera/dma_buffer.hpp"
#include "hal/libcamera/formats.hpp"
#include "hal/luma/luma.hpp"

namespace {

using namespace dtact::hal;
using libcamera_backend::DmaHeap;
using libcamera_backend::Mapping;
namespace lc = libcamera;

constexpr int kWidth = 800;
constexpr int kHeight = 600;
constexpr std::size_t kBytes = std::size_t{kWidth} * kHeight;

double median_us(const std::function<void()>& read) {
  std::array<std::int64_t, 31> times{};
  for (std::int64_t& ns : times) {
    const std::int64_t begin = dtact::base::system_clock().monotonic_ns();
    read();
    ns = dtact::base::system_clock().monotonic_ns() - begin;
  }
  std::ranges::sort(times);
  return static_cast<double>(times[times.size() / 2]) / 1000;
}

/// Each reading begins with the cache synchronisation of a frame (`fd` < 0: no DMA buffer),
/// which empties the caches of cached memory.
void measure(const std::string& name, int fd, std::span<const std::uint8_t> bytes) {
  luma::LumaBuffer out(kWidth, kHeight);
  const auto bracketed = [&](const std::function<void()>& read) {
    return median_us([&] {
      if (fd >= 0 && !libcamera_backend::sync_for_reading(fd, true)) std::abort();
      read();
      if (fd >= 0 && !libcamera_backend::sync_for_reading(fd, false)) std::abort();
    });
  };
  const auto extract = [&](luma::Range range) {
    return bracketed([&] {
      if (luma::extract(luma::Layout::grey, range, bytes.first(kBytes), 0, out) !=
          luma::ExtractStatus::ok) {
        std::abort();
      }
    });
  };
  const double each = bracketed([&] {
    const volatile std::uint8_t* each_byte = bytes.data();
    std::uint8_t seen = 0;
    for (std::size_t i = 0; i < kBytes; ++i) seen |= each_byte[i];
    out.data()[0] = seen;
  });
  fmt::print("{:40} {:10.1f} {:10.1f} {:10.1f}\n", name, each, extract(luma::Range::full),
             extract(luma::Range::limited));
}

void measure_heap(const char* node) {
  const DmaHeap heap(std::span(&node, 1));
  const dtact::base::UniqueFd buffer = heap.allocate(kBytes);
  if (!buffer) {
    fmt::print("{:40} not here, or not for this user\n", node);
    return;
  }
  measure(node, buffer.get(), Mapping(buffer.get(), kBytes).bytes());
}

void measure_driver() {
  lc::CameraManager manager;
  if (manager.start() != 0) return;
  for (const std::shared_ptr<lc::Camera>& camera : manager.cameras()) {
    if (libcamera_backend::sensor_of(camera->properties()) == libcamera_backend::Sensor::none ||
        camera->acquire() != 0) {
      continue;
    }
    const auto configuration = camera->generateConfiguration({lc::StreamRole::VideoRecording});
    CameraConfig asked;
    asked.width = kWidth;
    asked.height = kHeight;
    (void)libcamera_backend::choose_format(*configuration, asked, libcamera_backend::Sensor::colour,
                                           camera->id());
    lc::FrameBufferAllocator allocator(camera);
    lc::StreamConfiguration& stream = configuration->at(0);
    if (camera->configure(configuration.get()) == 0 && allocator.allocate(stream.stream()) > 0) {
      const lc::FrameBuffer::Plane& luma = allocator.buffers(stream.stream())[0]->planes()[0];
      measure(camera->id(), luma.fd.get(),
              Mapping(luma.fd.get(), luma.offset + luma.length).bytes().subspan(luma.offset));
    }
    allocator.free(stream.stream());
    camera->release();
    return;
  }
  fmt::print("{:40} no bare sensor is attached\n", "a driver's own");
}

}  // namespace

int main() {
  try {
    fmt::print("{:40} {:>10} {:>10} {:>10}\n", "800x600 bytes, us", "bytewise", "full", "limited");
    measure("this program's", -1, std::vector<std::uint8_t>(kBytes, 1));
    for (const char* node : libcamera_backend::kCachedHeaps) measure_heap(node);
    measure_heap("/dev/dma_heap/system");
    measure_driver();
    return EXIT_SUCCESS;
  } catch (const std::exception& e) {
    fmt::print(stderr, "bench_memory: {}\n", e.what());
    return EXIT_FAILURE;
  }
}
