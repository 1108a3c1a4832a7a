#include "tests/kernel/camera/played_frames.hpp"

#include <jpeglib.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <memory>
#include <stdexcept>
#include <string>

namespace dtact::kernel_test {
namespace {

using Image = std::vector<std::uint8_t>;
constexpr int kWidth = PlayedFrames::kWidth;
constexpr int kHeight = PlayedFrames::kHeight;

/// Interleaved Y Cb Cr: a ramp under a bright bar that moves from picture to picture.
Image picture(int number) {
  Image pixels;
  pixels.reserve(std::size_t{3} * kWidth * kHeight);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const bool bar = x >= number * 100 && x < number * 100 + 50;
      const int luma = y % 40 < 3 ? y & 255 : bar ? 250 : x * 240 / kWidth;
      pixels.push_back(static_cast<std::uint8_t>(luma));
      pixels.push_back(static_cast<std::uint8_t>(x / 8 + 64));
      pixels.push_back(static_cast<std::uint8_t>(y / 8 + 64));
    }
  }
  return pixels;
}

std::string encode_ycc(const Image& ycc) {
  jpeg_compress_struct c{};
  jpeg_error_mgr errors{};
  c.err = jpeg_std_error(&errors);
  jpeg_create_compress(&c);
  unsigned char* memory = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&c, &memory, &size);
  c.image_width = kWidth;
  c.image_height = kHeight;
  c.input_components = 3;
  c.in_color_space = JCS_YCbCr;
  jpeg_set_defaults(&c);
  jpeg_set_quality(&c, 85, TRUE);
  c.comp_info[0].v_samp_factor = 1;  // 4:2:2
  jpeg_start_compress(&c, TRUE);
  while (c.next_scanline < c.image_height) {
    auto* row = const_cast<JSAMPROW>(&ycc[std::size_t{3} * kWidth * c.next_scanline]);
    jpeg_write_scanlines(&c, &row, 1);
  }
  jpeg_finish_compress(&c);
  jpeg_destroy_compress(&c);
  const std::unique_ptr<unsigned char, decltype(&std::free)> owner(memory, &std::free);
  return {reinterpret_cast<const char*>(memory), size};
}

/// Decodes all three components with libjpeg and keeps the first: independent of
/// the HAL's decoding to grey.
Image decode_luma(const std::string& jpeg) {
  jpeg_decompress_struct d{};
  jpeg_error_mgr errors{};
  d.err = jpeg_std_error(&errors);
  jpeg_create_decompress(&d);
  jpeg_mem_src(&d, reinterpret_cast<const unsigned char*>(jpeg.data()), jpeg.size());
  jpeg_read_header(&d, TRUE);
  d.out_color_space = JCS_YCbCr;
  jpeg_start_decompress(&d);
  Image luma;
  Image row(std::size_t{3} * kWidth);
  while (d.output_scanline < d.output_height) {
    JSAMPROW rows = row.data();
    jpeg_read_scanlines(&d, &rows, 1);
    for (std::size_t x = 0; x < kWidth; ++x) luma.push_back(row[3 * x]);
  }
  jpeg_finish_decompress(&d);
  jpeg_destroy_decompress(&d);
  return luma;
}

/// Y0 U Y1 V with luma squeezed into 16…235.
std::string pack_yuyv(const Image& ycc, Image& expected) {
  std::string bytes;
  for (std::size_t i = 0; i < ycc.size(); i += 3) {
    const int y = 16 + ycc[i] * 219 / 255;
    bytes += static_cast<char>(y);
    bytes += static_cast<char>(128);
    expected.push_back(static_cast<std::uint8_t>(std::lround((y - 16) * 255.0 / 219)));
  }
  return bytes;
}

void write(const std::filesystem::path& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
}

}  // namespace

std::string encode_jpeg(const image::Grey8& picture) {
  if (picture.width != kWidth || picture.height != kHeight) {
    throw std::invalid_argument("the fake camera plays pictures of 800x600");
  }
  Image ycc;
  ycc.reserve(3 * picture.pixels.size());
  for (const std::uint8_t grey : picture.pixels) ycc.insert(ycc.end(), {grey, 128, 128});
  return encode_ycc(ycc);
}

PlayedFrames::PlayedFrames() {
  std::string name = std::filesystem::temp_directory_path() / "dtact-frames.XXXXXX";
  if (::mkdtemp(name.data()) == nullptr) throw std::runtime_error("no temporary folder");
  folder_ = name;
  for (int i = 0; i < kCount; ++i) {
    const Image ycc = picture(i);
    const std::string jpeg = encode_ycc(ycc);
    jpeg_luma_.push_back(decode_luma(jpeg));
    yuyv_luma_.emplace_back();
    write(folder_ / (std::to_string(i) + ".jpg"), jpeg);
    write(folder_ / (std::to_string(i) + ".yuv"), pack_yuyv(ycc, yuyv_luma_.back()));
  }
}

PlayedFrames::~PlayedFrames() {
  std::error_code error;
  std::filesystem::remove_all(folder_, error);
}

int PlayedFrames::match(const std::vector<Image>& images, const hal::LumaView& luma) {
  if (luma.width != kWidth || luma.height != kHeight) return -1;
  for (int i = 0; i < kCount; ++i) {
    const Image& image = images[static_cast<std::size_t>(i)];
    bool equal = true;
    for (int y = 0; equal && y < kHeight; ++y) {
      equal = std::memcmp(luma.row(y), &image[static_cast<std::size_t>(y) * kWidth], kWidth) == 0;
    }
    if (equal) return i;
  }
  return -1;
}

}  // namespace dtact::kernel_test
