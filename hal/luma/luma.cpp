#include "hal/luma/luma.hpp"

#include <array>
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

namespace {

constexpr std::uint8_t expand(int y) {
  if (y <= 16) return 0;
  if (y >= 235) return 255;
  // 219 is odd, so no product lies halfway and adding 109 before the division rounds to nearest.
  return static_cast<std::uint8_t>(((y - 16) * 255 + 109) / 219);
}

constexpr std::array<std::uint8_t, 256> make_expansion() {
  std::array<std::uint8_t, 256> table{};
  for (int y = 0; y < 256; ++y) table[static_cast<std::size_t>(y)] = expand(y);
  return table;
}

constexpr auto kExpansion = make_expansion();

int pixel_bytes(Layout layout) noexcept {
  return layout == Layout::grey || layout == Layout::nv12 ? 1 : 2;
}

bool has_chroma(Layout layout) noexcept { return layout == Layout::yuyv || layout == Layout::nv12; }

void copy_line(Layout layout, const std::uint8_t* in, std::uint8_t* out, int width) noexcept {
  const auto pair = [in](int x) { return in + std::ptrdiff_t{2} * x; };
  switch (layout) {
    case Layout::grey:
    case Layout::nv12:
      std::memcpy(out, in, static_cast<std::size_t>(width));
      return;
    case Layout::grey10:
      for (int x = 0; x < width; ++x) {
        out[x] = static_cast<std::uint8_t>(pair(x)[0] >> 2U | pair(x)[1] << 6U);
      }
      return;
    case Layout::grey16:
      for (int x = 0; x < width; ++x) out[x] = pair(x)[1];
      return;
    case Layout::yuyv:
      for (int x = 0; x < width; ++x) out[x] = *pair(x);
      return;
  }
}

}  // namespace

std::size_t payload_bytes(Layout layout, int width, int height,
                          std::ptrdiff_t bytes_per_line) noexcept {
  const std::ptrdiff_t packed = std::ptrdiff_t{pixel_bytes(layout)} * width;
  const std::ptrdiff_t line = bytes_per_line == 0 ? packed : bytes_per_line;
  const std::ptrdiff_t lines = layout == Layout::nv12 ? height + height / 2 : height;
  return static_cast<std::size_t>((lines - 1) * line + packed);
}

ExtractStatus extract(Layout layout, Range range, std::span<const std::uint8_t> payload,
                      std::ptrdiff_t bytes_per_line, LumaBuffer& out) noexcept {
  const int width = out.width();
  const int height = out.height();
  const std::ptrdiff_t packed = std::ptrdiff_t{pixel_bytes(layout)} * width;
  const std::ptrdiff_t line = bytes_per_line == 0 ? packed : bytes_per_line;
  const bool odd =
      (has_chroma(layout) && width % 2 != 0) || (layout == Layout::nv12 && height % 2 != 0);
  if (height < 1 || line < packed || odd) return ExtractStatus::bad_shape;
  if (payload.size() < payload_bytes(layout, width, height, line)) {
    return ExtractStatus::short_payload;
  }
  for (int y = 0; y < height; ++y) {
    std::uint8_t* row = out.row(y);
    copy_line(layout, payload.data() + y * line, row, width);
    // In the copy: looking values up reads byte by byte.
    if (range == Range::limited) {
      for (int x = 0; x < width; ++x) row[x] = kExpansion[row[x]];
    }
  }
  return ExtractStatus::ok;
}

}  // namespace dtact::hal::luma
