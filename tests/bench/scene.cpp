#include "tests/bench/scene.hpp"

// clang-format off: jpeglib.h uses FILE and size_t without declaring them.
#include <cstdio>
#include <jpeglib.h>
// clang-format on

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <random>

namespace dtact::bench {
namespace {

constexpr double kCentreX = 0.5 * (kFrameWidth - 1);
constexpr double kCentreY = 0.5 * (kFrameHeight - 1);

double light(double x, double y) {
  const double r = std::hypot(x - kCentreX, y - kCentreY) / 500;
  return 165 - 45 * r * r;
}

/// Change of a press against the radius, 1 = end of the bulge: sensor_a's ball has half its
/// darkening at 0.32, none at 0.43 and its brightest ring at 0.56 of that radius.
double darkening(double r) {
  if (r >= 1) return 0;
  if (r < 0.43) return kLastGrey * (1 - std::pow(r / 0.43, 2.4));
  const double bulge = (r - 0.43) / 0.57;
  return -22 * 5.2 * bulge * std::pow(1 - bulge, 3.0) * 1.8;
}

std::uint8_t grey(double value) {
  return static_cast<std::uint8_t>(std::clamp(std::lround(value), 0L, 255L));
}

}  // namespace

LensMap make_lens_map() {
  // A wide lens's barrel distortion: a pixel at the map's corner (radius 410) is read at 0.84 of
  // its radius.
  LensMap map;
  for (int v = 0; v < kMapSide; ++v) {
    for (int u = 0; u < kMapSide; ++u) {
      const double x = u - 0.5 * (kMapSide - 1);
      const double y = v - 0.5 * (kMapSide - 1);
      const double r2 = (x * x + y * y) / (410.0 * 410.0);
      const double scale = 1.0 - 0.2 * r2 + 0.04 * r2 * r2;
      map.x.push_back(static_cast<float>(kCentreX + x * scale));
      map.y.push_back(static_cast<float>(kCentreY + y * scale));
    }
  }
  return map;
}

recon::RectifyTable make_lens_table(const LensMap& map) {
  recon::RectifyTable table{kFrameWidth, kFrameHeight, kMapSide, kMapSide, {}};
  for (std::size_t i = 0; i < map.x.size(); ++i) {
    const long x = std::lround(map.x[i] * 128);
    const long y = std::lround(map.y[i] * 128);
    const long left = std::min<long>(x / 128, kFrameWidth - 2);
    const long upper = std::min<long>(y / 128, kFrameHeight - 2);
    table.entries.push_back({static_cast<std::int16_t>(left), static_cast<std::int16_t>(upper),
                             static_cast<std::uint8_t>(x - left * 128),
                             static_cast<std::uint8_t>(y - upper * 128)});
  }
  return table;
}

recon::Model make_model() {
  recon::Model model;
  model.rectify = make_lens_table(make_lens_map());
  model.mm_per_px = 24.0 / kMapSide;
  model.smoothing_px = 2;
  model.lut.first_q6 = -40 * 64;
  for (int q6 = -40 * 64; q6 <= 110 * 64; ++q6) {
    model.lut.um.push_back(
        static_cast<std::int16_t>(std::lround(q6 < 0 ? q6 * 9 / 64.0 : q6 / 2.0)));
  }
  model.lut.covered_from_q6 = model.lut.first_q6;
  model.lut.covered_to_q6 = 110 * 64;
  model.reference_q8 = make_reference_q8();
  return model;
}

std::vector<std::uint16_t> make_reference_q8() {
  std::vector<std::uint16_t> reference;
  for (int y = 0; y < kFrameHeight; ++y) {
    for (int x = 0; x < kFrameWidth; ++x) {
      reference.push_back(static_cast<std::uint16_t>(std::lround(256 * light(x, y))));
    }
  }
  return reference;
}

Image make_frame(double radius_px, unsigned seed) {
  std::minstd_rand random(seed);
  const auto noise = [&random] {
    // The sum of four uniform numbers, of standard deviation one: Gaussian enough.
    double sum = 0;
    for (int i = 0; i < 4; ++i)
      sum += static_cast<double>(random()) / std::minstd_rand::max() - 0.5;
    return sum * std::sqrt(3.0);
  };
  Image frame;
  frame.reserve(std::size_t{kFrameWidth} * kFrameHeight);
  for (int y = 0; y < kFrameHeight; ++y) {
    for (int x = 0; x < kFrameWidth; ++x) {
      double change = 0;
      if (radius_px > 0) change = darkening(std::hypot(x - kCentreX, y - kCentreY) / radius_px);
      frame.push_back(grey(light(x, y) - change + noise()));
    }
  }
  return frame;
}

std::vector<std::uint8_t> make_jpeg(const Image& frame) {
  jpeg_compress_struct cinfo{};
  jpeg_error_mgr errors{};
  cinfo.err = jpeg_std_error(&errors);
  jpeg_create_compress(&cinfo);
  unsigned char* bytes = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&cinfo, &bytes, &size);
  cinfo.image_width = kFrameWidth;
  cinfo.image_height = kFrameHeight;
  cinfo.input_components = 3;
  cinfo.in_color_space = JCS_YCbCr;
  jpeg_set_defaults(&cinfo);
  jpeg_set_quality(&cinfo, 90, TRUE);
  cinfo.comp_info[0].h_samp_factor = 2;
  cinfo.comp_info[0].v_samp_factor = 1;
  jpeg_start_compress(&cinfo, TRUE);
  std::vector<JSAMPLE> row(std::size_t{kFrameWidth} * 3, 128);
  while (cinfo.next_scanline < cinfo.image_height) {
    const std::uint8_t* luma = frame.data() + std::size_t{cinfo.next_scanline} * kFrameWidth;
    for (std::size_t x = 0; x < kFrameWidth; ++x) row[3 * x] = luma[x];
    JSAMPROW rows = row.data();
    jpeg_write_scanlines(&cinfo, &rows, 1);
  }
  jpeg_finish_compress(&cinfo);
  std::vector<std::uint8_t> payload(bytes, bytes + size);
  jpeg_destroy_compress(&cinfo);
  std::free(bytes);
  return payload;
}

}  // namespace dtact::bench
