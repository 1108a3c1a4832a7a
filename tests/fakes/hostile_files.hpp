#pragma once

#include <zlib.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

// Small files that cost a careless reader much memory, time or stack.
namespace dtact::fakes {

/// `bytes` as zlib packs them best.
inline std::string deflated(std::string_view bytes) {
  uLongf size = ::compressBound(bytes.size());
  std::string packed(size, '\0');
  ::compress2(reinterpret_cast<Bytef*>(packed.data()), &size,
              reinterpret_cast<const Bytef*>(bytes.data()), bytes.size(), Z_BEST_COMPRESSION);
  packed.resize(size);
  return packed;
}

/// A chunk of a PNG: length, type, data, CRC-32 over type and data.
inline std::string png_chunk(const std::string& type, const std::string& data) {
  const auto word = [](std::uint32_t value) {
    std::string bytes;
    for (unsigned i = 0; i < 4; ++i) bytes += static_cast<char>(value >> (24U - 8U * i));
    return bytes;
  };
  const std::string body = type + data;
  const auto crc =
      ::crc32(0, reinterpret_cast<const Bytef*>(body.data()), static_cast<uInt>(body.size()));
  return word(static_cast<std::uint32_t>(data.size())) + body +
         word(static_cast<std::uint32_t>(crc));
}

/// `png` with `count` compressed texts of `bytes` each before its pixels.
inline std::string with_text_chunks(std::string png, int count, std::size_t bytes) {
  const std::string text =
      png_chunk("zTXt", std::string("Comment\0\0", 9) + deflated(std::string(bytes, 'x')));
  std::string chunks;
  for (int i = 0; i < count; ++i) chunks += text;
  constexpr std::size_t kAfterHeader = 8 + 25;  // the signature and IHDR
  return png.insert(kAfterHeader, chunks);
}

/// An empty picture, 16-bit grey, width x height pixels.
inline std::string grey16_png(std::uint32_t width, std::uint32_t height) {
  std::string header;
  for (const std::uint32_t side : {width, height}) {
    for (unsigned i = 0; i < 4; ++i) header += static_cast<char>(side >> (24U - 8U * i));
  }
  header += std::string("\x10\0\0\0\0", 5);
  const std::string rows(std::size_t{height} * (std::size_t{width} * 2 + 1), '\0');
  return "\x89PNG\r\n\x1A\n" + png_chunk("IHDR", header) + png_chunk("IDAT", deflated(rows)) +
         png_chunk("IEND", "");
}

/// "a.a.a = 1", `depth` tables within each other.
inline std::string deep_toml(int depth) {
  std::string text;
  for (int i = 0; i < depth; ++i) text += "a.";
  return text + "a = 1\n";
}

/// An array of small numbers, `bytes` long.
inline std::string wide_toml(std::size_t bytes) {
  std::string text = "a = [";
  while (text.size() + 2 < bytes) text += "1,";
  return text + "]\n";
}

/// Keys without end, `bytes` long.
inline std::string many_keys_toml(std::size_t bytes) {
  std::string text;
  for (int i = 0; text.size() < bytes; ++i) text += "k" + std::to_string(i) + "=1\n";
  return text;
}

}  // namespace dtact::fakes
