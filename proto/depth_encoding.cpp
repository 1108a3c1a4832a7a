#include "proto/depth_encoding.hpp"

#include <zstd.h>

#include <bit>
#include <cstring>
#include <stdexcept>

// Maps are copied to and from the wire as they lie in memory.
static_assert(std::endian::native == std::endian::little, "the wire's int16 are little-endian");

namespace dtact::wire {
namespace {

constexpr int kZstdLevel = 1;

bool plausible(std::size_t width, std::size_t height) noexcept {
  return width > 0 && height > 0 && width <= kMaxPixels && height <= kMaxPixels / width;
}

/// Running sums in each row, in place.
void undo_differences(std::span<std::int16_t> depth, std::size_t width) noexcept {
  for (std::size_t row = 0; row < depth.size(); row += width) {
    std::uint16_t left = 0;
    for (auto& pixel : depth.subspan(row, width)) {
      left = static_cast<std::uint16_t>(left + static_cast<std::uint16_t>(pixel));
      pixel = static_cast<std::int16_t>(left);
    }
  }
}

}  // namespace

void encode_int16(std::span<const std::int16_t> depth, std::string& out) {
  out.assign(reinterpret_cast<const char*>(depth.data()), depth.size_bytes());
}

bool decode_int16(std::string_view bytes, std::size_t width, std::size_t height,
                  std::vector<std::int16_t>& depth) {
  if (!plausible(width, height) || bytes.size() != 2 * width * height) return false;
  depth.resize(width * height);
  std::memcpy(depth.data(), bytes.data(), bytes.size());
  return true;
}

struct DeltaZstdEncoder::Impl {
  struct Free {
    void operator()(ZSTD_CCtx* used) const noexcept { ZSTD_freeCCtx(used); }
  };
  std::unique_ptr<ZSTD_CCtx, Free> context{ZSTD_createCCtx()};
  std::vector<std::uint16_t> differences;
};

DeltaZstdEncoder::DeltaZstdEncoder() : impl_(std::make_unique<Impl>()) {
  if (!impl_->context) throw std::bad_alloc();
}
DeltaZstdEncoder::~DeltaZstdEncoder() = default;
DeltaZstdEncoder::DeltaZstdEncoder(DeltaZstdEncoder&&) noexcept = default;
DeltaZstdEncoder& DeltaZstdEncoder::operator=(DeltaZstdEncoder&&) noexcept = default;

void DeltaZstdEncoder::encode(std::span<const std::int16_t> depth, std::size_t width,
                              std::string& out) {
  if (width == 0 || depth.size() % width != 0) {
    throw std::invalid_argument("a depth map of " + std::to_string(depth.size()) +
                                " pixels has no whole number of rows of " + std::to_string(width));
  }
  auto& differences = impl_->differences;
  differences.resize(depth.size());
  for (std::size_t row = 0; row < depth.size(); row += width) {
    const std::int16_t* from = depth.data() + row;
    std::uint16_t* to = differences.data() + row;
    to[0] = static_cast<std::uint16_t>(from[0]);
    for (std::size_t x = 1; x < width; ++x)
      to[x] = static_cast<std::uint16_t>(from[x] - from[x - 1]);
  }
  const std::size_t bytes = 2 * differences.size();
  out.resize(ZSTD_compressBound(bytes));
  const std::size_t size = ZSTD_compressCCtx(impl_->context.get(), out.data(), out.size(),
                                             differences.data(), bytes, kZstdLevel);
  if (ZSTD_isError(size) != 0) {
    throw std::runtime_error(std::string("cannot compress a depth map: ") +
                             ZSTD_getErrorName(size));
  }
  out.resize(size);
}

bool decode_delta_zstd(std::string_view bytes, std::size_t width, std::size_t height,
                       std::vector<std::int16_t>& depth) {
  if (!plausible(width, height)) return false;
  const std::size_t size = 2 * width * height;
  // What the frame says of itself comes first, so that a short message cannot make us allocate.
  if (ZSTD_getFrameContentSize(bytes.data(), bytes.size()) != size) return false;
  if (ZSTD_findFrameCompressedSize(bytes.data(), bytes.size()) != bytes.size()) return false;
  depth.resize(width * height);
  if (ZSTD_decompress(depth.data(), size, bytes.data(), bytes.size()) != size) return false;
  undo_differences(depth, width);
  return true;
}

}  // namespace dtact::wire
