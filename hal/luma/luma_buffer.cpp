#include "hal/luma/luma_buffer.hpp"

#include <cstring>
#include <new>
#include <stdexcept>
#include <utility>

namespace dtact::hal::luma {
namespace {

constexpr int kMaxSide = 16384;

std::ptrdiff_t checked_stride(int width, int height) {
  if (width < 1 || height < 1 || width > kMaxSide || height > kMaxSide) {
    throw std::invalid_argument("luma buffer: width and height must be 1 to 16384 pixels");
  }
  constexpr auto kStep = static_cast<std::ptrdiff_t>(LumaBuffer::kAlignment);
  return (width + kStep - 1) / kStep * kStep;
}

}  // namespace

LumaBuffer::LumaBuffer(int width, int height)
    : width_(width), height_(height), stride_(checked_stride(width, height)) {
  const std::size_t size =
      static_cast<std::size_t>(stride_) * static_cast<std::size_t>(height) + kLumaPadding;
  bytes_.reset(static_cast<std::uint8_t*>(::operator new[](size, std::align_val_t{kAlignment})));
  std::memset(bytes_.get(), 0, size);
}

LumaBuffer::LumaBuffer(LumaBuffer&& other) noexcept { *this = std::move(other); }

LumaBuffer& LumaBuffer::operator=(LumaBuffer&& other) noexcept {
  if (this == &other) return *this;
  bytes_ = std::move(other.bytes_);
  width_ = std::exchange(other.width_, 0);
  height_ = std::exchange(other.height_, 0);
  stride_ = std::exchange(other.stride_, 0);
  return *this;
}

void LumaBuffer::Free::operator()(std::uint8_t* bytes) const noexcept {
  ::operator delete[](bytes, std::align_val_t{kAlignment});
}

}  // namespace dtact::hal::luma
