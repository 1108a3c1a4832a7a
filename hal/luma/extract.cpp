#include "hal/luma/extract.hpp"

#include <array>
#include <cstring>

namespace dtact::hal::luma {
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

std::ptrdiff_t packed_line(Layout layout, int width) noexcept {
  return layout == Layout::yuyv ? std::ptrdiff_t{2} * width : width;
}

template <int kStep>
void copy_line(const std::uint8_t* in, std::uint8_t* out, int width, Range range) noexcept {
  if (range == Range::limited) {
    for (int x = 0; x < width; ++x) out[x] = kExpansion[in[std::ptrdiff_t{kStep} * x]];
  } else if constexpr (kStep == 1) {
    std::memcpy(out, in, static_cast<std::size_t>(width));
  } else {
    for (int x = 0; x < width; ++x) out[x] = in[std::ptrdiff_t{kStep} * x];
  }
}

}  // namespace

std::uint8_t expand_limited(std::uint8_t y) noexcept { return kExpansion[y]; }

std::size_t payload_bytes(Layout layout, int width, int height,
                          std::ptrdiff_t bytes_per_line) noexcept {
  const std::ptrdiff_t packed = packed_line(layout, width);
  const std::ptrdiff_t line = bytes_per_line == 0 ? packed : bytes_per_line;
  const std::ptrdiff_t lines = layout == Layout::nv12 ? height + height / 2 : height;
  return static_cast<std::size_t>((lines - 1) * line + packed);
}

ExtractStatus extract(Layout layout, Range range, std::span<const std::uint8_t> payload,
                      std::ptrdiff_t bytes_per_line, LumaBuffer& out) noexcept {
  const int width = out.width();
  const int height = out.height();
  const std::ptrdiff_t packed = packed_line(layout, width);
  const std::ptrdiff_t line = bytes_per_line == 0 ? packed : bytes_per_line;
  const bool odd =
      (layout != Layout::grey && width % 2 != 0) || (layout == Layout::nv12 && height % 2 != 0);
  if (height < 1 || line < packed || odd) return ExtractStatus::bad_shape;
  if (payload.size() < payload_bytes(layout, width, height, line)) {
    return ExtractStatus::short_payload;
  }
  for (int y = 0; y < height; ++y) {
    const std::uint8_t* in = payload.data() + y * line;
    if (layout == Layout::yuyv) {
      copy_line<2>(in, out.row(y), width, range);
    } else {
      copy_line<1>(in, out.row(y), width, range);
    }
  }
  return ExtractStatus::ok;
}

}  // namespace dtact::hal::luma
