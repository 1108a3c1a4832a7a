#include "hal/sim/payload.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <vector>

#include "hal/mjpeg/jpeg_arena.hpp"

namespace dtact::hal::sim {
namespace {

constexpr std::size_t kSpare = std::size_t{256} * 1024;

// For 800 × 600 libjpeg needs 60 kB; this is four times that plus one line of everything.
std::size_t arena_bytes(int width) {
  return std::size_t{256} * 1024 + static_cast<std::size_t>(width) * 256;
}

// Rows that libjpeg reads at once: one row of 8 × 8 blocks.
constexpr int kRows = 8;

}  // namespace

class PayloadEncoder::Jpeg {
 public:
  Jpeg(int width, int height, int quality)
      : width_((width + 15) / 16 * 16), height_(height), arena_(arena_bytes(width)) {
    cinfo_.err = ::jpeg_std_error(&errors_);
    jpeg_create_compress(&cinfo_);
    cinfo_.image_width = static_cast<JDIMENSION>(width);
    cinfo_.image_height = static_cast<JDIMENSION>(height);
    cinfo_.input_components = 3;
    cinfo_.in_color_space = JCS_YCbCr;
    ::jpeg_set_defaults(&cinfo_);
    ::jpeg_set_quality(&cinfo_, quality, TRUE);
    cinfo_.raw_data_in = TRUE;
    cinfo_.dct_method = JDCT_IFAST;
    cinfo_.comp_info[0].h_samp_factor = 2;
    cinfo_.comp_info[0].v_samp_factor = 1;
    destination_.init_destination = [](j_compress_ptr) {};
    // capacity() is more than quality 95 can fill.
    destination_.empty_output_buffer = [](j_compress_ptr) -> boolean { std::abort(); };
    destination_.term_destination = [](j_compress_ptr) {};
    cinfo_.dest = &destination_;
    // What was set up so far stays with libjpeg's own manager; each picture lives in the arena.
    own_memory_ = cinfo_.mem;
    jpeg_decompress_struct lender{};
    arena_.attach(lender);
    arena_memory_ = lender.mem;

    const auto w = static_cast<std::size_t>(width_);
    luma_.resize(w * kRows);
    neutral_.resize(w / 2, 128);
    for (std::size_t i = 0; i < kRows; ++i) {
      luma_rows_[i] = luma_.data() + i * w;
      neutral_rows_[i] = neutral_.data();
    }
  }
  Jpeg(const Jpeg&) = delete;
  Jpeg& operator=(const Jpeg&) = delete;
  ~Jpeg() {
    cinfo_.mem = own_memory_;
    ::jpeg_destroy_compress(&cinfo_);
  }

  std::size_t encode(const LumaView& luma, std::span<std::uint8_t> out) noexcept {
    destination_.next_output_byte = out.data();
    destination_.free_in_buffer = out.size();
    cinfo_.mem = arena_memory_;
    ::jpeg_start_compress(&cinfo_, TRUE);
    std::array<JSAMPARRAY, 3> planes = {luma_rows_.data(), neutral_rows_.data(),
                                        neutral_rows_.data()};
    while (cinfo_.next_scanline < cinfo_.image_height) {
      const int first = static_cast<int>(cinfo_.next_scanline);
      for (int i = 0; i < kRows; ++i) {
        // Past the last row and column the picture repeats its border, as libjpeg wants.
        const std::uint8_t* const row = luma.row(std::min(first + i, height_ - 1));
        std::uint8_t* const to = luma_rows_[static_cast<std::size_t>(i)];
        std::memcpy(to, row, static_cast<std::size_t>(luma.width));
        std::fill(to + luma.width, to + width_, row[luma.width - 1]);
      }
      ::jpeg_write_raw_data(&cinfo_, planes.data(), kRows);
    }
    ::jpeg_finish_compress(&cinfo_);
    cinfo_.mem = own_memory_;
    arena_.reset();
    return out.size() - destination_.free_in_buffer;
  }

 private:
  int width_;  // whole blocks of 4:2:2
  int height_;
  mjpeg::JpegArena arena_;
  jpeg_error_mgr errors_{};
  jpeg_compress_struct cinfo_{};
  jpeg_destination_mgr destination_{};
  jpeg_memory_mgr* own_memory_ = nullptr;
  jpeg_memory_mgr* arena_memory_ = nullptr;
  std::vector<std::uint8_t> luma_;
  std::vector<std::uint8_t> neutral_;
  std::array<JSAMPROW, kRows> luma_rows_{};
  std::array<JSAMPROW, kRows> neutral_rows_{};
};

Output output_from_name(std::string_view name) {
  if (name == "luma") return Output::luma;
  if (name == "yuyv") return Output::yuyv;
  if (name == "mjpeg") return Output::mjpeg;
  throw std::runtime_error(
      fmt::format("camera.sim.output = \"{}\": allowed are luma, yuyv, mjpeg", name));
}

PayloadEncoder::PayloadEncoder(Output output, int width, int height, int jpeg_quality)
    : output_(output), width_(width), height_(height) {
  if (output != Output::luma && width % 2 != 0) {
    throw std::runtime_error(fmt::format(
        "camera.width = {}: yuyv and mjpeg share chroma between two pixels; choose an even width",
        width));
  }
  if (output == Output::mjpeg) jpeg_ = std::make_unique<Jpeg>(width, height, jpeg_quality);
}

PayloadEncoder::~PayloadEncoder() = default;

std::size_t PayloadEncoder::capacity() const noexcept {
  const std::size_t pixels = static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_);
  // At quality 95 a coefficient's code is at most 26 bits long: 3.25 bytes a pixel of luma, and
  // next to nothing for constant chroma. Blocks at the border are whole.
  return output_ == Output::mjpeg ? pixels * 4 + kSpare : pixels * 2;
}

std::size_t PayloadEncoder::encode(const LumaView& luma, std::span<std::uint8_t> out) noexcept {
  if (output_ == Output::mjpeg) return jpeg_->encode(luma, out);
  std::uint8_t* to = out.data();
  const auto width = static_cast<std::size_t>(width_);
  for (int y = 0; y < height_; ++y) {
    const std::uint8_t* const row = luma.row(y);
    if (output_ == Output::luma) {
      std::memcpy(to, row, width);
      to += width;
      continue;
    }
    for (std::size_t x = 0; x < width; ++x) {
      to[2 * x] = static_cast<std::uint8_t>(16 + (row[x] * 219 + 127) / 255);
      to[2 * x + 1] = 128;
    }
    to += 2 * width;
  }
  return static_cast<std::size_t>(to - out.data());
}

}  // namespace dtact::hal::sim
