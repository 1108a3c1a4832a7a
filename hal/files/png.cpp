#include "hal/files/png.hpp"

#include <fmt/format.h>
#include <png.h>

#include <csetjmp>
#include <cstddef>
#include <cstring>
#include <new>
#include <stdexcept>

#include "hal/base/atomic_file.hpp"

namespace dtact::image {
namespace {

/// Of any chunk that is read, bytes: libpng allows 8 MB, a palette has 768.
constexpr png_alloc_size_t kMaxChunk = 64U << 10U;

struct Reader {
  std::string_view bytes;
  std::string error;
};

void on_error(png_structp png, png_const_charp message) {
  static_cast<Reader*>(png_get_error_ptr(png))->error = message;
  png_longjmp(png, 1);
}
void on_warning(png_structp /*png*/, png_const_charp /*message*/) {}

void on_read(png_structp png, png_bytep out, std::size_t n) {
  auto& bytes = static_cast<Reader*>(png_get_io_ptr(png))->bytes;
  if (bytes.size() < n) png_error(png, "the file ends too early");
  std::memcpy(out, bytes.data(), n);
  bytes.remove_prefix(n);
}

void on_write(png_structp png, png_bytep data, std::size_t n) {
  static_cast<std::string*>(png_get_io_ptr(png))->append(reinterpret_cast<char*>(data), n);
}
void on_flush(png_structp /*png*/) {}

/// libpng's structures, freed on every path.
struct Structures {
  explicit Structures(bool for_writing) : writing(for_writing) {}
  ~Structures() {
    if (writing) {
      png_destroy_write_struct(&png, &info);
    } else {
      png_destroy_read_struct(&png, &info, nullptr);
    }
  }
  Structures(const Structures&) = delete;
  Structures& operator=(const Structures&) = delete;

  /// Throws std::bad_alloc where libpng got no memory.
  void take(png_structp created) {
    png = created;
    if (png != nullptr) info = png_create_info_struct(png);
    if (info == nullptr) throw std::bad_alloc();
  }

  bool writing;
  png_structp png = nullptr;
  png_infop info = nullptr;
};

/// Decoded samples, 16 bits in the machine's order when `wide`, grey or r g b.
struct Samples {
  int width = 0;
  int height = 0;
  int channels = 0;
  bool wide = false;
  std::vector<std::uint8_t> bytes;
};

// setjmp and C++ objects: everything with a destructor lives in the caller's frame.
bool read_samples(png_structp png, png_infop info, Samples& out, std::vector<png_bytep>& rows) {
  if (setjmp(png_jmpbuf(png)) != 0) return false;
  png_set_user_limits(png, kMaxPngSide, kMaxPngSide);
  png_set_chunk_malloc_max(png, kMaxChunk);
  // Skips texts, colour profiles and the like unread.
  png_set_keep_unknown_chunks(png, PNG_HANDLE_CHUNK_NEVER, nullptr, -1);
  png_read_info(png, info);
  png_set_expand(png);
  png_set_strip_alpha(png);
  if (png_get_bit_depth(png, info) == 16) png_set_swap(png);
  png_set_interlace_handling(png);
  png_read_update_info(png, info);
  out.width = static_cast<int>(png_get_image_width(png, info));
  out.height = static_cast<int>(png_get_image_height(png, info));
  out.channels = png_get_channels(png, info);
  out.wide = png_get_bit_depth(png, info) == 16;
  const std::size_t row_bytes = png_get_rowbytes(png, info);
  out.bytes.resize(row_bytes * static_cast<std::size_t>(out.height));
  rows.resize(static_cast<std::size_t>(out.height));
  for (std::size_t y = 0; y < rows.size(); ++y) rows[y] = out.bytes.data() + y * row_bytes;
  png_read_image(png, rows.data());
  png_read_end(png, nullptr);
  return true;
}

Samples decode(std::string_view bytes, const std::string& name) {
  (void)png_header(bytes, name);
  Reader reader{bytes, {}};
  Structures libpng(false);
  libpng.take(png_create_read_struct(PNG_LIBPNG_VER_STRING, &reader, on_error, on_warning));
  png_set_read_fn(libpng.png, &reader, on_read);
  Samples samples;
  std::vector<png_bytep> rows;
  if (!read_samples(libpng.png, libpng.info, samples, rows)) {
    throw std::runtime_error(name + ": not a readable PNG: " + reader.error);
  }
  return samples;
}

std::uint16_t sample(const Samples& s, std::size_t i) {
  if (!s.wide) return static_cast<std::uint16_t>(s.bytes[i] * 257U);
  std::uint16_t value = 0;
  std::memcpy(&value, s.bytes.data() + i * 2, 2);
  return value;
}

Grey16 to_grey16(const Samples& s) {
  Grey16 grey{s.width, s.height, {}};
  const std::size_t n = static_cast<std::size_t>(s.width) * static_cast<std::size_t>(s.height);
  grey.pixels.resize(n);
  const auto channels = static_cast<std::size_t>(s.channels);
  for (std::size_t i = 0; i < n; ++i) {
    if (channels < 3) {
      grey.pixels[i] = sample(s, i * channels);
    } else {
      // BT.601 in thousandths, rounded.
      const std::uint32_t sum = 299U * sample(s, i * channels) +
                                587U * sample(s, i * channels + 1) +
                                114U * sample(s, i * channels + 2);
      grey.pixels[i] = static_cast<std::uint16_t>((sum + 500U) / 1000U);
    }
  }
  return grey;
}

bool write_rows(png_structp png, png_infop info, int width, int height, int depth, int colour,
                const std::uint8_t* data, std::size_t row_bytes) {
  if (setjmp(png_jmpbuf(png)) != 0) return false;
  // Camera images are noisy. With the left neighbour as the only prediction, level 4 takes a
  // quarter of the time of libpng's defaults (6.4 ms against 28 ms for 640x480), and the files are
  // no larger.
  png_set_compression_level(png, 4);
  png_set_filter(png, PNG_FILTER_TYPE_BASE, PNG_FILTER_SUB);
  png_set_IHDR(png, info, static_cast<png_uint_32>(width), static_cast<png_uint_32>(height), depth,
               colour, PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  png_write_info(png, info);
  if (depth == 16) png_set_swap(png);
  for (int y = 0; y < height; ++y) {
    png_write_row(png, data + static_cast<std::size_t>(y) * row_bytes);
  }
  png_write_end(png, info);
  return true;
}

std::string encode(int width, int height, int depth, int colour, const std::uint8_t* data,
                   std::size_t row_bytes) {
  std::string out;
  Reader reader;
  Structures libpng(true);
  libpng.take(png_create_write_struct(PNG_LIBPNG_VER_STRING, &reader, on_error, on_warning));
  png_set_write_fn(libpng.png, &out, on_write, on_flush);
  if (!write_rows(libpng.png, libpng.info, width, height, depth, colour, data, row_bytes)) {
    throw std::runtime_error("cannot encode PNG: " + reader.error);
  }
  return out;
}

}  // namespace

PngHeader png_header(std::string_view bytes, const std::string& name) {
  // PNG specification, 5.2 and 11.2.2: the signature, then IHDR's length, type and data.
  constexpr std::string_view kStart("\x89PNG\r\n\x1A\n\0\0\0\x0DIHDR", 16);
  constexpr std::size_t kSize = kStart.size() + 10;
  if (bytes.size() < kSize || !bytes.starts_with(kStart)) {
    throw std::runtime_error(name + ": not a readable PNG: it does not begin as one");
  }
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(bytes[i]); };
  const auto side = [&](std::size_t i) {
    return std::uint32_t{byte(i)} << 24U | std::uint32_t{byte(i + 1)} << 16U |
           std::uint32_t{byte(i + 2)} << 8U | byte(i + 3);
  };
  const std::uint32_t width = side(kStart.size());
  const std::uint32_t height = side(kStart.size() + 4);
  if (width < 1 || height < 1 || width > kMaxPngSide || height > kMaxPngSide ||
      std::uint64_t{width} * height > kMaxPngPixels) {
    throw std::runtime_error(fmt::format(
        "{}: is {}x{} pixels; at most {} a side and {} in all are read: make the image smaller",
        name, width, height, kMaxPngSide, kMaxPngPixels));
  }
  return {.width = static_cast<int>(width),
          .height = static_cast<int>(height),
          .bits = byte(kStart.size() + 8),
          .grey = byte(kStart.size() + 9) == PNG_COLOR_TYPE_GRAY};
}

Grey16 decode_png_grey16(std::string_view bytes, const std::string& name) {
  return to_grey16(decode(bytes, name));
}

Grey16 read_png_grey16(const std::filesystem::path& path) {
  return decode_png_grey16(base::read_file(path), path.string());
}

Grey8 read_png_grey8(const std::filesystem::path& path) {
  const Grey16 wide = read_png_grey16(path);
  Grey8 grey{wide.width, wide.height, {}};
  grey.pixels.resize(wide.pixels.size());
  for (std::size_t i = 0; i < grey.pixels.size(); ++i) {
    grey.pixels[i] = static_cast<std::uint8_t>((wide.pixels[i] + 128U) / 257U);
  }
  return grey;
}

std::string encode_png(const Grey8& image) {
  return encode(image.width, image.height, 8, PNG_COLOR_TYPE_GRAY, image.pixels.data(),
                static_cast<std::size_t>(image.width));
}

std::string encode_png(const Grey16& image) {
  return encode(image.width, image.height, 16, PNG_COLOR_TYPE_GRAY,
                reinterpret_cast<const std::uint8_t*>(image.pixels.data()),
                static_cast<std::size_t>(image.width) * 2);
}

std::string encode_png(const Rgb8& image) {
  return encode(image.width, image.height, 8, PNG_COLOR_TYPE_RGB, image.pixels.data(),
                static_cast<std::size_t>(image.width) * 3);
}

}  // namespace dtact::image
