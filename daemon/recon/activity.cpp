#include "daemon/recon/activity.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace dtact::recon {
namespace {

constexpr int kCell = vec::kCell;

/// Drift is followed on every sixteenth frame, in steps of sixteen frames.
constexpr int kDriftEvery = 16;

/// Weight of a new frame in the noise's slow mean.
constexpr double kNoiseWeight = 1.0 / 64;

}  // namespace

std::int32_t Activity::q16(double levels) noexcept {
  return static_cast<std::int32_t>(std::lround(levels * kQ16));
}

Activity::Activity(const RectifyTable& table, int radius, const ActivitySettings& settings)
    : settings_(settings),
      grid_(table.width, table.height),
      frame_width_(table.frame_width),
      frame_height_(table.frame_height),
      tiles_(static_cast<std::size_t>(grid_.rows()), grid_.all()) {
  if (frame_width_ < kCell || frame_height_ < kCell) return;
  const FrameRegion read = region_read(table);
  columns_ = (read.width + kCell - 1) / kCell;
  rows_ = (read.height + kCell - 1) / kCell;
  // Whole cells inside the frame if they fit; else the last ones overlap those before (x_of).
  x_ = std::clamp(read.x, 0, std::max(0, frame_width_ - columns_ * kCell));
  y_ = std::clamp(read.y, 0, std::max(0, frame_height_ - rows_ * kCell));
  stride_ = vec::padded_cells(columns_);
  const std::size_t cells = at(0, rows_);
  margin_ = static_cast<std::size_t>(stride_) + vec::kCellBlock;
  for (auto* plane : {&taken_, &reference_, &drift_, &expected_, &sum_, &sum_before_, &upper_,
                      &upper_before_, &rough_, &cell_}) {
    plane->resize(cells);
  }
  for (auto* plane : {&change_, &window_, &active_}) plane->resize(cells + 2 * margin_);
  readers_.resize(cells);
  find_readers(table, radius);
}

int Activity::x_of(int column) const noexcept {
  return std::min(x_ + column * kCell, frame_width_ - kCell);
}

int Activity::y_of(int row) const noexcept {
  return std::min(y_ + row * kCell, frame_height_ - kCell);
}

void Activity::follow(const Activity& other) noexcept {
  const bool same = x_ == other.x_ && y_ == other.y_ && columns_ == other.columns_ &&
                    rows_ == other.rows_ && reference_ == other.reference_;
  if (!same) return;
  drift_ = other.drift_;
  expected_ = other.expected_;
  sum_ = other.sum_;
  sum_before_ = other.sum_before_;
  upper_ = other.upper_;
  upper_before_ = other.upper_before_;
  cell_ = other.cell_;
  window_ = other.window_;
  active_ = other.active_;
  noise_ = other.noise_;
  mean_drift_ = other.mean_drift_;
  active_cells_ = other.active_cells_;
  frames_ = other.frames_;
}

FrameRegion Activity::region() const noexcept {
  if (columns_ == 0) return {0, 0, frame_width_, frame_height_};
  return {x_, y_, x_of(columns_ - 1) + kCell - x_, y_of(rows_ - 1) + kCell - y_};
}

void Activity::find_readers(const RectifyTable& table, int radius) {
  for (int row = 0; row < grid_.rows(); ++row) {
    for (int column = 0; column < grid_.columns(); ++column) {
      const int left = std::max(0, column * grid_.tile_width() - radius);
      const int right = std::min(grid_.width, (column + 1) * grid_.tile_width() + radius);
      const int top = std::max(0, row * TileGrid::kRows - radius);
      const int bottom = std::min(grid_.height, (row + 1) * TileGrid::kRows + radius);
      int x0 = INT16_MAX;
      int x1 = 0;
      int y0 = INT16_MAX;
      int y1 = 0;
      for (int y = top * table.decimation; y < bottom * table.decimation; ++y) {
        for (int x = left * table.decimation; x < right * table.decimation; ++x) {
          const RectifyTable::Entry& e =
              table.entries[static_cast<std::size_t>(y) *
                                static_cast<std::size_t>(table.fine_width()) +
                            static_cast<std::size_t>(x)];
          x0 = std::min<int>(x0, e.x);
          x1 = std::max(x1, e.x + 1);
          y0 = std::min<int>(y0, e.y);
          y1 = std::max(y1, e.y + 1);
        }
      }
      for (int cy = (y0 - y_) / kCell; cy <= std::min((y1 - y_) / kCell, rows_ - 1); ++cy) {
        for (int cx = (x0 - x_) / kCell; cx <= std::min((x1 - x_) / kCell, columns_ - 1); ++cx) {
          Readers& readers = readers_[at(cx, cy)];
          readers = {std::min(readers.first_column, column),
                     std::max(readers.last_column, column + 1), std::min(readers.first_row, row),
                     std::max(readers.last_row, row + 1)};
        }
      }
    }
  }
}

void Activity::set_reference(std::span<const std::uint16_t> reference_q8) noexcept {
  for (int row = 0; row < rows_; ++row) {
    for (int column = 0; column < columns_; ++column) {
      std::int32_t sum = 0;
      for (int y = y_of(row); y < y_of(row) + kCell; y += vec::kRowStep) {
        const auto line = reference_q8.subspan(
            static_cast<std::size_t>(y) * static_cast<std::size_t>(frame_width_) +
                static_cast<std::size_t>(x_of(column)),
            kCell);
        sum = std::accumulate(line.begin(), line.end(), sum);
      }
      taken_[at(column, row)] = sum * (256 / vec::kCellPixels);  // Q8 to a mean in Q16
    }
  }
  for (auto* plane : {&drift_, &cell_, &window_, &active_}) std::ranges::fill(*plane, 0);
  mean_drift_ = 0;
  active_cells_ = 0;
  frames_ = 0;
  set_light(1);
}

void Activity::set_light(double factor) noexcept {
  double sum = 0;
  for (std::size_t i = 0; i < taken_.size(); ++i) {
    reference_[i] = static_cast<std::int32_t>(std::lround(factor * taken_[i]));
    expected_[i] = reference_[i] + drift_[i];
    sum += reference_[i];
  }
  mean_reference_ = sum / kQ16 / std::max(1, columns_ * rows_);
}

vec::ChangeLimits Activity::limits() const noexcept {
  const auto limit = [this](double floor, double ceiling, double noise) {
    return q16(std::clamp(settings_.factor * noise, floor, ceiling));
  };
  const std::int32_t cell = limit(settings_.cell_floor, settings_.cell_ceiling, noise_);
  // A window's mean of four independent cells is half as noisy.
  const std::int32_t window = limit(settings_.window_floor, settings_.window_ceiling, noise_ / 2);
  return {cell, cell / 2, window, window / 2};
}

void Activity::sum(const std::uint8_t* luma, std::ptrdiff_t stride,
                   vec::CellCounts& counts) noexcept {
  std::swap(sum_, sum_before_);
  std::swap(upper_, upper_before_);
  const bool overlap = x_ + columns_ * kCell > frame_width_;
  for (int row = 0; row < rows_; ++row) {
    const std::uint8_t* const from = luma + y_of(row) * stride;
    const std::size_t i = at(0, row);
    vec::sum_cells(from + x_, stride, overlap ? columns_ - 1 : columns_, settings_.limits, &sum_[i],
                   &upper_[i], &rough_[i], counts);
    if (overlap) {
      const std::size_t last = at(columns_ - 1, row);
      vec::sum_cells(from + x_of(columns_ - 1), stride, 1, settings_.limits, &sum_[last],
                     &upper_[last], &rough_[last], counts);
    }
  }
}

void Activity::mark() noexcept {
  std::ranges::fill(tiles_, std::uint64_t{0});
  if (active_cells_ == 0) return;
  for (int row = 0; row < rows_; ++row) {
    const std::span<const std::int32_t> flags =
        std::span(active_).subspan(margin_ + at(0, row), static_cast<std::size_t>(columns_));
    if (std::accumulate(flags.begin(), flags.end(), 0) == 0) continue;
    for (int column = 0; column < columns_; ++column) {
      if (flags[static_cast<std::size_t>(column)] == 0) continue;
      const Readers& readers = readers_[at(column, row)];
      if (readers.first_column >= readers.last_column) continue;
      const std::uint64_t columns = (~std::uint64_t{0} << readers.first_column) &
                                    (~std::uint64_t{0} >> (64 - readers.last_column));
      for (int tile = readers.first_row; tile < readers.last_row; ++tile) {
        tiles_[static_cast<std::size_t>(tile)] |= columns;
      }
    }
  }
}

bool Activity::touched(int column, int row) const noexcept {
  // The planes' margins and padding are quiet.
  for (int y = row - 1; y <= row + 1; ++y) {
    for (int x = column - 1; x <= column + 1; ++x) {
      const std::ptrdiff_t i = std::ptrdiff_t{y} * stride_ + x;
      if (active_[static_cast<std::size_t>(static_cast<std::ptrdiff_t>(margin_) + i)] != 0) {
        return true;
      }
    }
  }
  return false;
}

void Activity::follow_drift() noexcept {
  const std::int32_t step = q16(settings_.drift_per_frame * kDriftEvery);
  const std::int32_t limit = q16(settings_.drift_limit);
  const int cells = columns_ * rows_;
  std::int64_t total = 0;
  const auto move = [&](std::size_t i, std::int32_t by) {
    const std::int32_t before = drift_[i];
    drift_[i] = std::clamp(before + by, -limit, limit);
    expected_[i] = reference_[i] + drift_[i];
    total += drift_[i];
    return drift_[i] - before;
  };
  std::int64_t moved = 0;
  int quiet = 0;
  for (int row = 0; row < rows_; ++row) {
    for (int column = 0; column < columns_; ++column) {
      const std::size_t i = at(column, row);
      if (active_cells_ > 0 && touched(column, row)) continue;
      moved += move(i, std::clamp(change_[margin_ + i], -step, step));
      ++quiet;
    }
  }
  // Light moves as a whole: touched cells go along with what the quiet ones did, whatever they
  // show themselves. Otherwise drift would light up ring after ring around a press.
  const auto common = static_cast<std::int32_t>(2 * quiet > cells ? moved / quiet : 0);
  for (int row = 0; row < rows_ && active_cells_ > 0; ++row) {
    for (int column = 0; column < columns_; ++column) {
      if (touched(column, row)) (void)move(at(column, row), common);
    }
  }
  mean_drift_ = static_cast<double>(total) / cells / kQ16;
}

const TileRows& Activity::look(const std::uint8_t* luma, std::ptrdiff_t stride,
                               ActivityReport& report) noexcept {
  report = {};
  report.tiles = grid_.rows() * grid_.columns();
  report.active_tiles = report.tiles;
  if (columns_ == 0) return tiles_;

  vec::CellCounts counts;
  sum(luma, stride, counts);
  const int cells = columns_ * rows_;
  const int quiet = cells - active_cells_;
  const vec::ChangeLimits change_limits = limits();
  const vec::CellTotals totals = vec::compare_cells(
      {stride_, rows_, columns_ - (x_of(columns_ - 1) < x_ + (columns_ - 1) * kCell ? 2 : 1),
       rows_ - (y_of(rows_ - 1) < y_ + (rows_ - 1) * kCell ? 2 : 1), sum_.data(),
       sum_before_.data(), rough_.data(), expected_.data(), change_.data() + margin_, cell_.data(),
       window_.data() + margin_, active_.data() + margin_},
      change_limits);
  active_cells_ = totals.active;
  mark();
  const auto mean = [quiet](std::int64_t total) {
    return static_cast<double>(total) / std::max(1, quiet);
  };
  if (frames_ > 0 && quiet > 0) {
    const double now = kFromDifference * mean(totals.quiet_step) / vec::kCellPixels;
    noise_ += (noise_ == 0 ? 1 : kNoiseWeight) * (now - noise_);
  }
  if (++frames_ % kDriftEvery == 0) follow_drift();

  if (frames_ > 1) compare_with_before(report);
  report.mean_grey = static_cast<double>(totals.grey) / cells / vec::kCellPixels;
  report.pixel_noise = kFromDifference * mean(totals.quiet_rough) / vec::kRoughPixels;
  report.cell_noise = noise_;
  report.quiet_change = mean(totals.quiet_change) / 256;
  report.drift = mean_drift_;
  compare_light(change_limits, quiet == cells && active_cells_ == 0, report);
  report.pixels = std::int64_t{cells} * vec::kCellPixels;
  report.saturated = counts.saturated;
  report.dark = counts.dark;
  report.cells = cells;
  report.active_cells = active_cells_;
  report.active_tiles = count_tiles(tiles_);
  return tiles_;
}

}  // namespace dtact::recon
