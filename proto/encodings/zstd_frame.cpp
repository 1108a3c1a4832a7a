#include "proto/encodings/zstd_frame.hpp"

// For ZSTD_c_literalCompressionMode, which the shared library has since 1.3.8: a setting of the
// compressor, the frames are those of RFC 8878.
#define ZSTD_STATIC_LINKING_ONLY
#include <zstd.h>

#include <new>
#include <stdexcept>

namespace dtact::wire {
namespace {

constexpr int kAlways = 1;  // ZSTD_lcm_huffman before 1.5.0, ZSTD_ps_enable since

}  // namespace

struct ZstdCompressor::Impl {
  struct Free {
    void operator()(ZSTD_CCtx* used) const noexcept { ZSTD_freeCCtx(used); }
  };
  std::unique_ptr<ZSTD_CCtx, Free> context{ZSTD_createCCtx()};
  std::vector<char> frame;  ///< Grows to the worst case, which `out` need not.

  void set(ZSTD_cParameter parameter, int value) const {
    if (value == 0) return;
    const std::size_t set = ZSTD_CCtx_setParameter(context.get(), parameter, value);
    if (ZSTD_isError(set) != 0) throw std::invalid_argument(ZSTD_getErrorName(set));
  }
};

ZstdCompressor::ZstdCompressor(const ZstdSettings& settings) : impl_(std::make_unique<Impl>()) {
  if (!impl_->context) throw std::bad_alloc();
  impl_->set(ZSTD_c_compressionLevel, settings.level);
  impl_->set(ZSTD_c_minMatch, settings.min_match);
  impl_->set(ZSTD_c_hashLog, settings.hash_log);
  impl_->set(ZSTD_c_targetLength, settings.target_length);
  // A hurried search would switch the entropy code off as well, which is all that noise needs.
  impl_->set(ZSTD_c_literalCompressionMode, kAlways);
}
ZstdCompressor::~ZstdCompressor() = default;
ZstdCompressor::ZstdCompressor(ZstdCompressor&&) noexcept = default;
ZstdCompressor& ZstdCompressor::operator=(ZstdCompressor&&) noexcept = default;

void ZstdCompressor::compress(std::span<const std::byte> content, std::string& out) {
  auto& frame = impl_->frame;
  if (const std::size_t most = ZSTD_compressBound(content.size()); frame.size() < most) {
    frame.resize(most);
  }
  const std::size_t size = ZSTD_compress2(impl_->context.get(), frame.data(), frame.size(),
                                          content.data(), content.size());
  if (ZSTD_isError(size) != 0) {
    throw std::runtime_error(std::string("cannot compress a depth map: ") +
                             ZSTD_getErrorName(size));
  }
  out.assign(frame.data(), size);
}

std::optional<std::size_t> zstd_content_size(std::string_view bytes) noexcept {
  const auto size = ZSTD_getFrameContentSize(bytes.data(), bytes.size());
  if (size == ZSTD_CONTENTSIZE_UNKNOWN || size == ZSTD_CONTENTSIZE_ERROR) return std::nullopt;
  return size;
}

bool zstd_decompress(std::string_view bytes, std::span<std::byte> content) noexcept {
  if (ZSTD_findFrameCompressedSize(bytes.data(), bytes.size()) != bytes.size()) return false;
  return ZSTD_decompress(content.data(), content.size(), bytes.data(), bytes.size()) ==
         content.size();
}

}  // namespace dtact::wire
