#include "clients/calibrate/guided/cells.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace dtact::ctl::guided {
namespace {

constexpr int kCellsAcross = 48;
constexpr int kMinPx = 12;
constexpr int kMinCells = 8;
/// Grey levels that a surface without any contact does not reach.
constexpr double kBrighter = 8;

}  // namespace

CellGrid::CellGrid(const recon::FrameRegion& region)
    : region_(region),
      cell_(std::max(kMinPx, std::min(region.width, region.height) / kCellsAcross)) {
  if (std::min(region.width, region.height) < kMinCells * kMinPx) {
    throw std::invalid_argument(
        "the depth map is smaller than 96 pixels, too little to see a press in: give a larger "
        "--crop");
  }
}

template <typename Pixel>
CellMeans CellGrid::means(const std::vector<Pixel>& pixels, int width, double scale) const {
  const auto columns = static_cast<std::size_t>(region_.width / cell_);
  const auto rows = static_cast<std::size_t>(region_.height / cell_);
  const auto side = static_cast<std::size_t>(cell_);
  CellMeans cells(columns * rows);
  for (std::size_t row = 0; row < rows; ++row) {
    for (std::size_t column = 0; column < columns; ++column) {
      std::uint64_t sum = 0;
      for (std::size_t y = 0; y < side; ++y) {
        const std::size_t line = static_cast<std::size_t>(region_.y) + row * side + y;
        const std::size_t start = line * static_cast<std::size_t>(width) +
                                  static_cast<std::size_t>(region_.x) + column * side;
        for (std::size_t x = 0; x < side; ++x) sum += pixels[start + x];
      }
      const auto count = static_cast<double>(side * side);
      cells[row * columns + column] = static_cast<float>(scale * static_cast<double>(sum) / count);
    }
  }
  return cells;
}

CellMeans CellGrid::of(const std::vector<std::uint8_t>& luma, int width) const {
  return means(luma, width, 1);
}

CellMeans CellGrid::of(const std::vector<std::uint16_t>& luma_q8, int width) const {
  return means(luma_q8, width, 1.0 / 256);
}

ContactEvidence compare(const CellMeans& reference, const CellMeans& now) {
  std::vector<float> darker(reference.size());
  std::ranges::transform(reference, now, darker.begin(), std::minus<>());
  std::vector<float> sorted = darker;
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::ranges::nth_element(sorted, middle);
  ContactEvidence seen;
  seen.light = *middle;
  const auto [least, most] = std::ranges::minmax(darker);
  seen.darkest = most - seen.light;
  seen.brightest = seen.light - least;
  seen.dark_cells = static_cast<double>(
      std::ranges::count_if(darker, [&](float d) { return d - seen.light > kEdgeLevels; }));
  return seen;
}

bool reference_in_contact(const ContactEvidence& seen) {
  return seen.brightest > std::max(kBrighter, seen.darkest);
}

double largest_change(const CellMeans& a, const CellMeans& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    largest = std::max<double>(largest, std::abs(a[i] - b[i]));
  }
  return largest;
}

int Steadiness::add(const CellMeans& cells) {
  if (row_ > 0) {
    const double change = largest_change(first_, cells);
    if (change <= tolerance_) return ++row_;
    broke_at_ = change;
  }
  first_ = cells;
  row_ = 1;
  return row_;
}

}  // namespace dtact::ctl::guided
