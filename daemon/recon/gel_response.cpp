#include "daemon/recon/gel_response.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <numbers>
#include <numeric>
#include <stdexcept>

#include "daemon/recon/model.hpp"

namespace dtact::recon {
namespace {

constexpr double kCellMm = 0.66;
constexpr int kMaxColumns = 64;
constexpr float kPressedMm = 0.04F;
constexpr float kContactMm = 0.1F;
constexpr double kBlur = 0.2;  // of the thickness
constexpr std::size_t kMaxCells = 144;
constexpr int kSteps = 5;  // of conjugate gradients; 12 change the force by 0.5 %

std::size_t index_of(int row, int columns, int column) {
  return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) +
         static_cast<std::size_t>(column);
}

double compliance(double k, double h) {
  const double kh = k * h;
  if (kh < 1e-3) return kh * kh * h;
  // The ratio is 1 to the last digit long before cosh overflows.
  const double ratio =
      kh > 20 ? 1 : (std::sinh(2 * kh) - 2 * kh) / (std::cosh(2 * kh) + 1 + 2 * kh * kh);
  return 3 / (2 * k) * ratio;
}

/// The mean over a square cell of what a unit pressure on another makes: C(k) times the blur and
/// both cells' spectra, by a cosine sum over a period that keeps the next copies 20 mm away.
std::vector<float> green(int columns, int rows, double cell, double h) {
  constexpr double kGapMm = 20;
  const double blur = kBlur * h;
  const double dk = 2 * std::numbers::pi / (std::max(columns, rows) * cell + kGapMm);
  const int count = static_cast<int>(4 / blur / dk) + 1;
  const auto n = static_cast<std::size_t>(count);
  std::vector<double> spectrum(n);
  for (std::size_t i = 0; i < n; ++i) {
    const double k = dk * static_cast<double>(i);
    const double half = k * cell / 2;
    const double sinc = half > 0 ? std::sin(half) / half : 1;
    spectrum[i] = (i == 0 ? 1 : 2) * sinc * sinc * std::exp(-k * k * blur * blur / 2) * cell * dk /
                  (2 * std::numbers::pi);
  }
  const auto cosines = [&](int size) {
    std::vector<double> all;
    for (int at = 0; at < size; ++at) {
      for (int i = 0; i < count; ++i) all.push_back(std::cos(dk * i * at * cell));
    }
    return all;
  };
  const std::vector<double> across = cosines(columns);
  const std::vector<double> down = cosines(rows);
  std::vector<double> half_way(n * static_cast<std::size_t>(columns));  // by ky and column
  std::vector<double> row(n);
  for (std::size_t y = 0; y < n; ++y) {
    for (std::size_t x = 0; x < n; ++x) {
      row[x] = spectrum[x] * spectrum[y] *
               compliance(dk * std::hypot(static_cast<double>(x), static_cast<double>(y)), h);
    }
    for (int c = 0; c < columns; ++c) {
      half_way[y * static_cast<std::size_t>(columns) + static_cast<std::size_t>(c)] =
          std::inner_product(row.begin(), row.end(), across.begin() + std::ptrdiff_t{c} * count,
                             0.0);
    }
  }
  std::vector<float> all;
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) {
      double sum = 0;
      for (std::size_t y = 0; y < n; ++y) {
        sum += down[static_cast<std::size_t>(r) * n + y] *
               half_way[y * static_cast<std::size_t>(columns) + static_cast<std::size_t>(c)];
      }
      all.push_back(static_cast<float>(sum));
    }
  }
  return all;
}

}  // namespace

CellMap::CellMap(int width, int height, double mm_per_px)
    : grid_(width, height),
      cell_px_(std::max({1, static_cast<int>(std::lround(kCellMm / mm_per_px)),
                         (std::max(width, height) - 1) / kMaxColumns + 1})),
      cell_mm_(cell_px_ * mm_per_px),
      columns_(width / cell_px_),
      rows_(height / cell_px_),
      mm_(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_)),
      sums_(static_cast<std::size_t>(width)),
      untrusted_(static_cast<std::size_t>(width)) {
  if (mm_.empty()) throw std::invalid_argument("the depth map is too small to measure force");
}

void CellMap::read(std::span<const std::int16_t> depth_um) {
  read(depth_um, TileRows(static_cast<std::size_t>(grid_.rows()), grid_.all()));
}

// Depth is smooth: four rows of a cell stand for it.
int CellMap::row_step() const noexcept { return std::max(1, cell_px_ / 4); }

int CellMap::read_pixels() const noexcept {
  return (cell_px_ + row_step() - 1) / row_step() * cell_px_;
}

bool CellMap::rest_is_pressed(std::span<const std::int16_t> depth_um,
                              const TileRows& tiles) const noexcept {
  int pressed = 0;
  for (int y = 0; y < grid_.height; y += row_step()) {
    const std::uint64_t word = tiles[static_cast<std::size_t>(y / TileGrid::kRows)];
    const int begin = std::max(std::countr_zero(word) * grid_.tile_width(),
                               y < rows_ * cell_px_ ? columns_ * cell_px_ : 0);
    const int end =
        std::min(static_cast<int>(std::bit_width(word)) * grid_.tile_width(), grid_.width);
    const std::int16_t* const at = depth_um.data() + std::ptrdiff_t{y} * grid_.width;
    for (int x = begin; x < end; ++x) pressed += at[x] > 1000 * kContactMm ? 1 : 0;
  }
  return 4 * pressed >= read_pixels();
}

void CellMap::read(std::span<const std::int16_t> depth_um, const TileRows& tiles) noexcept {
  const int step = row_step();
  const int pixels = read_pixels();
  rest_pressed_ = rest_is_pressed(depth_um, tiles);
  std::ranges::fill(mm_, 0.0F);
  for (int row = 0; row < rows_; ++row) {
    bool any = false;
    std::ranges::fill(sums_, 0);
    std::ranges::fill(untrusted_, 0);
    for (int y = row * cell_px_; y < (row + 1) * cell_px_; y += step) {
      const std::uint64_t word = tiles[static_cast<std::size_t>(y / TileGrid::kRows)];
      if (word == 0) continue;
      any = true;
      const int begin = std::countr_zero(word) * grid_.tile_width();
      const int end =
          std::min(static_cast<int>(std::bit_width(word)) * grid_.tile_width(), grid_.width);
      const std::int16_t* const at = depth_um.data() + std::ptrdiff_t{y} * grid_.width;
      std::int32_t* const sums = sums_.data();
      std::int32_t* const untrusted = untrusted_.data();
      for (int x = begin; x < end; ++x) {
        const bool out = at[x] == kUntrusted;
        sums[x] += out ? 0 : at[x];
        untrusted[x] += out ? 1 : 0;
      }
    }
    for (int column = 0; any && column < columns_; ++column) {
      const auto from = std::ptrdiff_t{column} * cell_px_;
      const auto total = [&](const std::vector<std::int32_t>& of) {
        return std::accumulate(of.begin() + from, of.begin() + from + cell_px_, 0);
      };
      const int trusted = pixels - total(untrusted_);
      mm_[index_of(row, columns_, column)] =
          2 * trusted > pixels
              ? static_cast<float>(total(sums_)) / static_cast<float>(1000 * trusted)
              : std::numeric_limits<float>::quiet_NaN();
    }
  }
}

bool CellMap::cut_off() const noexcept {
  if (rest_pressed_) return true;
  const auto known = [&](int column, int row) {
    return column >= 0 && row >= 0 && column < columns_ && row < rows_ &&
           !std::isnan(mm_[index_of(row, columns_, column)]);
  };
  for (int row = 0; row < rows_; ++row) {
    for (int column = 0; column < columns_; ++column) {
      if (!(mm_[index_of(row, columns_, column)] > kContactMm)) continue;
      if (!known(column - 1, row) || !known(column + 1, row) || !known(column, row - 1) ||
          !known(column, row + 1)) {
        return true;
      }
    }
  }
  return false;
}

GelResponse::GelResponse(double thickness_mm, const CellMap& shape) {
  int columns = shape.columns();
  int rows = shape.rows();
  double cell_mm = shape.cell_mm();
  while (true) {
    const auto size = static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows);
    levels_.push_back({columns, rows, cell_mm, green(columns, rows, cell_mm, thickness_mm),
                       std::vector<float>(size)});
    if (size <= kMaxCells) break;
    columns /= 2;
    rows /= 2;
    cell_mm *= 2;
  }
  cells_.reserve(kMaxCells);
  matrix_.resize(kMaxCells * kMaxCells);
  for (std::vector<float>* each : {&q_, &residual_, &direction_, &product_}) {
    each->resize(kMaxCells);
  }
}

GelResponse::Answer GelResponse::answer(const CellMap& map) noexcept {
  std::ranges::copy(map.mm(), levels_.front().mm.begin());
  std::size_t at = 0;
  while (!collect(levels_[at])) {
    const Level& fine = levels_[at];
    Level& coarse = levels_[++at];
    for (int row = 0; row < coarse.rows; ++row) {
      for (int column = 0; column < coarse.columns; ++column) {
        const auto first = index_of(2 * row, fine.columns, 2 * column);
        const auto below = first + static_cast<std::size_t>(fine.columns);
        coarse.mm[index_of(row, coarse.columns, column)] =
            (fine.mm[first] + fine.mm[first + 1] + fine.mm[below] + fine.mm[below + 1]) / 4;
      }
    }
  }
  const Level& level = levels_[at];
  solve(level);
  Answer answer;
  const double area = level.cell_mm * level.cell_mm;
  for (std::size_t i = 0; i < cells_.size(); ++i) {
    answer.mm2 += area * static_cast<double>(q_[i]) * static_cast<double>(cells_[i].mm);
    answer.mm += area * static_cast<double>(q_[i]);
  }
  return answer;
}

/// False: more than kMaxCells.
bool GelResponse::collect(const Level& level) noexcept {
  cells_.clear();
  for (int row = 0; row < level.rows; ++row) {
    for (int column = 0; column < level.columns; ++column) {
      const float mm = level.mm[index_of(row, level.columns, column)];
      if (!(mm > kPressedMm)) continue;
      if (cells_.size() == kMaxCells) return false;
      cells_.push_back({column, row, mm});
    }
  }
  return true;
}

/// Conjugate gradients for an indentation of 1 in all cells.
void GelResponse::solve(const Level& level) noexcept {
  const std::size_t n = cells_.size();
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      matrix_[i * n + j] = matrix_[j * n + i] =
          level.green[index_of(std::abs(cells_[i].row - cells_[j].row), level.columns,
                               std::abs(cells_[i].column - cells_[j].column))];
    }
  }
  const auto dot = [n](const std::vector<float>& a, const std::vector<float>& b) {
    return std::inner_product(a.begin(), a.begin() + static_cast<std::ptrdiff_t>(n), b.begin(),
                              0.0F);
  };
  std::fill_n(q_.begin(), n, 0.0F);
  std::fill_n(residual_.begin(), n, 1.0F);
  std::fill_n(direction_.begin(), n, 1.0F);
  float squares = static_cast<float>(n);
  for (int step = 0; step < kSteps && squares > 1e-6F * static_cast<float>(n); ++step) {
    std::fill_n(product_.begin(), n, 0.0F);
    for (std::size_t i = 0; i < n; ++i) {
      const float* const row = matrix_.data() + i * n;
      float* const to = product_.data();
      const float weight = direction_[i];
      for (std::size_t j = 0; j < n; ++j) to[j] += weight * row[j];
    }
    const float along = squares / dot(direction_, product_);
    for (std::size_t i = 0; i < n; ++i) {
      q_[i] += along * direction_[i];
      residual_[i] -= along * product_[i];
    }
    const float left = dot(residual_, residual_);
    for (std::size_t i = 0; i < n; ++i) {
      direction_[i] = residual_[i] + left / squares * direction_[i];
    }
    squares = left;
  }
}

}  // namespace dtact::recon
