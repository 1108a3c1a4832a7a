#include "tests/accuracy/table/judge.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "daemon/recon/model.hpp"
#include "tests/accuracy/table/configuration.hpp"

namespace dtact::table {

void Error::add(double error_mm) noexcept {
  sum_mm += std::abs(error_mm);
  ++pixels;
}

Error& Error::operator+=(const Error& other) noexcept {
  sum_mm += other.sum_mm;
  pixels += other.pixels;
  untrusted += other.untrusted;
  return *this;
}

double Error::mean_mm() const noexcept {
  if (pixels == 0) return std::numeric_limits<double>::quiet_NaN();
  return sum_mm / static_cast<double>(pixels);
}

Error against_circle(std::span<const std::int16_t> depth_um, const calibration::Circle& circle,
                     double ball_radius_mm) {
  const double r2 = ball_radius_mm * ball_radius_mm;
  const double edge_mm = circle.radius * kMmPerPx;
  const double edge = std::sqrt(std::max(0.0, r2 - edge_mm * edge_mm));
  Error error;
  std::size_t i = 0;
  for (int y = 0; y < kCrop; ++y) {
    for (int x = 0; x < kCrop; ++x, ++i) {
      const double mm = std::hypot(x - circle.col, y - circle.row) * kMmPerPx;
      if (mm >= edge_mm) continue;
      if (depth_um[i] == recon::kUntrusted) {
        ++error.untrusted;
      } else {
        error.add(0.001 * depth_um[i] - (std::sqrt(std::max(0.0, r2 - mm * mm)) - edge));
      }
    }
  }
  return error;
}

TruePress true_press(const hal::sim::Truth& truth, std::uint64_t sequence) {
  std::vector<float> map;
  std::vector<std::uint8_t> contact;
  truth.indentation_mm(sequence, map);
  truth.contact(sequence, contact);
  TruePress press;
  for (int y = kCropRow; y < kCropRow + kCrop; ++y) {
    const auto row = static_cast<std::ptrdiff_t>(y) * kFrameWidth + kCropCol;
    press.indentation_mm.insert(press.indentation_mm.end(), map.begin() + row,
                                map.begin() + row + kCrop);
    press.contact.insert(press.contact.end(), contact.begin() + row, contact.begin() + row + kCrop);
  }
  return press;
}

Error against_indentation(std::span<const std::int16_t> depth_um, const TruePress& press) {
  Error error;
  for (std::size_t i = 0; i < depth_um.size(); ++i) {
    if (press.contact[i] == 0) continue;
    if (depth_um[i] == recon::kUntrusted) {
      ++error.untrusted;
    } else {
      error.add(0.001 * depth_um[i] - static_cast<double>(press.indentation_mm[i]));
    }
  }
  return error;
}

}  // namespace dtact::table
