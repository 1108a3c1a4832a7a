#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace dtact::wire {

/// How to compress; 0 is the level's own choice. The names are zstd's.
struct ZstdSettings {
  int level = 1;
  int min_match = 0;
  int hash_log = 0;
  /// At level 1: how fast the search for matches walks over what matches nothing.
  int target_length = 0;
};

/// Makes zstd frames (RFC 8878) that state their content's size and carry no checksum. Holds zstd's
/// tables and scratch, so that steady use does not allocate. One thread at a time.
class ZstdCompressor {
 public:
  /// Throws std::bad_alloc.
  explicit ZstdCompressor(const ZstdSettings& settings);
  ~ZstdCompressor();
  ZstdCompressor(ZstdCompressor&&) noexcept;
  ZstdCompressor& operator=(ZstdCompressor&&) noexcept;

  /// Replaces `out`. Throws std::runtime_error with zstd's own word (out of memory).
  void compress(std::span<const std::byte> content, std::string& out);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// The content's size, when `bytes` begin with the head of a zstd frame that states it.
[[nodiscard]] std::optional<std::size_t> zstd_content_size(std::string_view bytes) noexcept;

/// False unless `bytes` are one whole zstd frame of exactly `content.size()` bytes.
[[nodiscard]] bool zstd_decompress(std::string_view bytes, std::span<std::byte> content) noexcept;

}  // namespace dtact::wire
