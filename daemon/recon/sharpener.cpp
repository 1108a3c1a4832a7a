#include "daemon/recon/sharpener.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "daemon/recon/vector_kernels.hpp"

namespace dtact::recon {
namespace {

using kernels::kCoarse;

constexpr double kWidestSigmaPx = 10;  // gaussian_taps()

constexpr int divide_up(int a, int b) { return (a + b - 1) / b; }
constexpr int even_up(int a) { return (a + 1) / 2 * 2; }

/// Standard deviation of the narrow Gaussian on the map, pixels.
double narrow_px(const Scattering& scattering, double mm_per_px) {
  return scattering.narrow_mm / mm_per_px;
}

/// Width of the wide Gaussian on the coarse grid, coarse pixels.
double wide_px(const Scattering& scattering, double mm_per_px) {
  constexpr double kSquare = kCoarse * kCoarse;
  // Variances add: of n equal steps (n² − 1) / 12, of bilinear reading n² / 6, averaged over
  // places.
  constexpr double kOwn = (kSquare - 1) / 12 + kSquare / 6;
  const double sigma_px = scattering.wide_mm / mm_per_px;
  return std::sqrt(std::max(0.0, sigma_px * sigma_px - kOwn)) / kCoarse;
}

[[noreturn]] void too_wide(const char* key, double mm, double max_mm, double mm_per_px) {
  throw std::invalid_argument("scattering." + std::string(key) + ": " + std::to_string(mm) +
                              " mm is more than the " + std::to_string(max_mm) +
                              " mm that a map of " + std::to_string(mm_per_px) +
                              " mm per pixel can be sharpened by; set reconstruction.sharpen = "
                              "\"auto\" or \"off\", or calibrate with a coarser mm_per_px");
}

}  // namespace

std::vector<std::int16_t> Sharpener::narrow_taps(const Scattering& scattering, double mm_per_px) {
  const double sigma_px = narrow_px(scattering, mm_per_px);
  if (sigma_px > kWidestSigmaPx) {
    too_wide("narrow_mm", scattering.narrow_mm, kWidestSigmaPx * mm_per_px, mm_per_px);
  }
  return gaussian_taps(sigma_px);
}

std::vector<std::int16_t> Sharpener::wide_taps(const Scattering& scattering, double mm_per_px) {
  const double sigma_px = wide_px(scattering, mm_per_px);
  if (sigma_px > kWidestSigmaPx) {
    too_wide("wide_mm", scattering.wide_mm, kCoarse * kWidestSigmaPx * mm_per_px, mm_per_px);
  }
  return gaussian_taps(sigma_px);
}

bool Sharpener::reaches(const Scattering& scattering, double mm_per_px) noexcept {
  return narrow_px(scattering, mm_per_px) <= kWidestSigmaPx &&
         wide_px(scattering, mm_per_px) <= kWidestSigmaPx;
}

std::int16_t Sharpener::wide_share_q15(const Scattering& scattering) noexcept {
  return static_cast<std::int16_t>(
      std::min(32767L, std::lround((1 - scattering.narrow_weight) * 32768)));
}

Sharpener::Sharpener(const Scattering& scattering, int steps, double mm_per_px, int width,
                     int height)
    : steps_(steps),
      width_(width),
      height_(height),
      coarse_width_(divide_up(width, kCoarse)),
      coarse_height_(divide_up(height, kCoarse)),
      wide_share_q15_(wide_share_q15(scattering)),
      narrow_(narrow_taps(scattering, mm_per_px), width, height),
      wide_(wide_taps(scattering, mm_per_px), coarse_width_, coarse_height_),
      level_(even_up(height), width),
      sharpened_(even_up(height), width),
      blurred_(2, width),
      coarse_(even_up(coarse_height_), coarse_width_),
      coarse_blurred_(even_up(coarse_height_), coarse_width_) {}

int Sharpener::step_reach() const noexcept {
  // Bilinear reading takes in one more coarse pixel.
  return std::max(narrow_.radius(), kCoarse * (wide_.radius() + 1));
}

MapArea Sharpener::widened(MapArea area) const noexcept {
  const int rows = divide_up(step_reach(), kCoarse) * kCoarse;
  const int blocks = divide_up(step_reach(), vec::kBlock);
  return {std::max(0, area.y0 - rows), std::min(height_, area.y1 + rows),
          std::max(0, area.first - blocks),
          std::min(divide_up(width_, vec::kBlock), area.last + blocks)};
}

MapArea Sharpener::needed(MapArea area) const noexcept {
  for (int i = 0; i < steps_; ++i) area = widened(area);
  return area;
}

void Sharpener::run(const MapArea& area) noexcept {
  if (area.y0 >= area.y1 || area.first >= area.last) return;
  // The first step goes from levels to sharpened ones, the second stays there: what it reads of a
  // row is read before the row is written.
  MapArea made = area;
  for (int i = 1; i < steps_; ++i) made = widened(made);
  step(level_, made);
  if (steps_ == 2) step(sharpened_, area);
}

void Sharpener::shrink(RowBuffer& from, const MapArea& area) noexcept {
  if (area.last * vec::kBlock >= width_) {
    for (int y = area.y0; y < area.y1; ++y) {
      std::fill_n(from.row(y) + width_, kCoarse - 1, from.row(y)[width_ - 1]);
    }
  }
  for (int k = area.y0 / kCoarse; k < divide_up(area.y1, kCoarse); ++k) {
    const std::int16_t* rows[kCoarse];
    for (int i = 0; i < kCoarse; ++i) rows[i] = from.row(std::min(kCoarse * k + i, height_ - 1));
    vec::shrink_row(rows, area.first, area.last, coarse_.row(k));
  }
}

void Sharpener::blur_coarse(const MapArea& area) noexcept {
  constexpr int kCells = vec::kBlock / kCoarse;  // of a block
  // One more on every side for the bilinear reading.
  const int first_row = std::max(0, area.y0 / kCoarse - 1);
  const int last_row = std::min(coarse_height_, divide_up(area.y1, kCoarse) + 1);
  const int first = std::max(0, area.first * kCells - 1) / vec::kBlock;
  const int last = divide_up(std::min(coarse_width_, area.last * kCells + 1), vec::kBlock);
  int pushed = std::max(0, first_row / 2 - wide_.reach());
  for (int pair = first_row / 2; pair < divide_up(last_row, 2); ++pair) {
    for (; pushed < std::min(wide_.pairs(), pair + wide_.reach() + 1); ++pushed) {
      wide_.push(pushed, coarse_.row(2 * pushed), coarse_.row(2 * pushed + 1), first, last);
    }
    wide_.take(pair, coarse_blurred_.row(2 * pair), coarse_blurred_.row(2 * pair + 1), first, last);
    for (int i = 0; i < 2; ++i) {
      std::int16_t* const row = coarse_blurred_.row(2 * pair + i);
      row[-1] = row[0];
      row[coarse_width_] = row[coarse_width_ - 1];
    }
  }
}

kernels::WideRows Sharpener::wide_rows(int y) noexcept {
  const int row = y / kCoarse;
  const int in = y % kCoarse;
  const int other = std::clamp(in < kCoarse / 2 ? row - 1 : row + 1, 0, coarse_height_ - 1);
  const bool far = in == 0 || in == kCoarse - 1;
  return {coarse_blurred_.row(row), coarse_blurred_.row(other),
          static_cast<std::int16_t>(far ? 3 * kernels::kEighth : kernels::kEighth)};
}

void Sharpener::step(RowBuffer& from, const MapArea& area) noexcept {
  shrink(from, widened(area));
  blur_coarse(area);
  int pushed = std::max(0, area.y0 / 2 - narrow_.reach());
  for (int pair = area.y0 / 2; pair < divide_up(area.y1, 2); ++pair) {
    for (; pushed < std::min(narrow_.pairs(), pair + narrow_.reach() + 1); ++pushed) {
      narrow_.push(pushed, from.row(2 * pushed), from.row(2 * pushed + 1), area.first, area.last);
    }
    narrow_.take(pair, blurred_.row(0), blurred_.row(1), area.first, area.last);
    for (int y = 2 * pair; y < std::min(2 * pair + 2, area.y1); ++y) {
      vec::sharpen_row({level_.row(y), from.row(y), blurred_.row(y % 2), wide_rows(y)},
                       wide_share_q15_, area.first, area.last, sharpened_.row(y));
    }
  }
}

}  // namespace dtact::recon
