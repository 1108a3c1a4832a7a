#include "daemon/pipeline/reference/contact_check.hpp"

#include <algorithm>
#include <cmath>

namespace dtact::pipeline {
namespace {

constexpr int kDegree = ContactCheck::kAnyShape;
constexpr int kRounds = 8;
/// Below this no residual counts as disagreement: noise of a cell and its quantisation.
constexpr double kMinScaleGrey = 0.3;
constexpr float kExplained = 0.01F;

template <typename Function>
void for_cells(const CellRegion& region, Function function) {
  for (int y = region.y0; y < region.y1; ++y) {
    for (int x = region.x0; x < region.x1; ++x) {
      function(cell_at(x, y));
    }
  }
}

/// Chebyshev polynomials of the first kind up to the degree, at t in −1 … 1.
std::array<double, kDegree + 1> chebyshev(double t) noexcept {
  return {1, t, 2 * t * t - 1, (4 * t * t - 3) * t, 8 * t * t * (t * t - 1) + 1};
}

template <std::size_t kSize>
double dot(const std::array<double, kSize>& a, const std::array<double, kSize>& b) noexcept {
  double sum = 0;
  for (std::size_t i = 0; i < kSize; ++i) sum += a[i] * b[i];
  return sum;
}

}  // namespace

ContactCheck::ContactCheck() : basis_(kGridCells) {
  for (int y = 0; y < kGridHeight; ++y) {
    const auto v = chebyshev(2.0 * (y + 0.5) / kGridHeight - 1);
    for (int x = 0; x < kGridWidth; ++x) {
      const auto u = chebyshev(2.0 * (x + 0.5) / kGridWidth - 1);
      std::size_t term = 0;
      Terms& terms = basis_[cell_at(x, y)];
      // By degree, so that a lower one uses the first terms only.
      for (std::size_t degree = 0; degree <= kDegree; ++degree) {
        for (std::size_t i = 0; i <= degree; ++i) terms[term++] = u[i] * v[degree - i];
      }
    }
  }
}

ContactCheck::Terms ContactCheck::solve(const LumaGrid& then, const LumaGrid& now,
                                        const CellRegion& region, int count) const noexcept {
  // Weighted normal equations, lower triangle, then Cholesky. The small diagonal keeps a region
  // that does not determine every term solvable.
  const auto terms = static_cast<std::size_t>(count);
  std::array<Terms, kTerms> a{};
  Terms b{};
  for_cells(region, [&](std::size_t cell) {
    const double light = then.cells[cell];
    const double weight = weight_[cell] * light;
    for (std::size_t i = 0; i < terms; ++i) {
      const double scaled = weight * basis_[cell][i];
      b[i] += scaled * now.cells[cell];
      for (std::size_t j = 0; j <= i; ++j) a[i][j] += scaled * light * basis_[cell][j];
    }
  });
  const double ridge = 1e-9 * a[0][0] + 1e-9;
  for (std::size_t i = 0; i < terms; ++i) {
    a[i][i] += ridge;
    for (std::size_t j = 0; j <= i; ++j) {
      double sum = a[i][j];
      for (std::size_t k = 0; k < j; ++k) sum -= a[i][k] * a[j][k];
      a[i][j] = i == j ? std::sqrt(std::max(sum, ridge)) : sum / a[j][j];
    }
  }
  for (std::size_t i = 0; i < terms; ++i) {
    for (std::size_t k = 0; k < i; ++k) b[i] -= a[i][k] * b[k];
    b[i] /= a[i][i];
  }
  for (std::size_t i = terms; i-- > 0;) {
    for (std::size_t k = i + 1; k < terms; ++k) b[i] -= a[k][i] * b[k];
    b[i] /= a[i][i];
  }
  return b;
}

void ContactCheck::reweigh(const LumaGrid& then, const LumaGrid& now, const CellRegion& region,
                           const Terms& terms) noexcept {
  std::size_t count = 0;
  const auto residual = [&](std::size_t cell) {
    return now.cells[cell] - then.cells[cell] * dot(basis_[cell], terms);
  };
  for_cells(region, [&](std::size_t cell) {
    scratch_[count++] = static_cast<float>(std::abs(residual(cell)));
  });
  if (count == 0) return;
  const auto middle = scratch_.begin() + static_cast<std::ptrdiff_t>(count / 2);
  std::nth_element(scratch_.begin(), middle, scratch_.begin() + static_cast<std::ptrdiff_t>(count));
  // 1.4826: median absolute deviation → standard deviation of a normal distribution.
  const double scale = std::max(1.4826 * *middle, kMinScaleGrey);
  for_cells(region, [&](std::size_t cell) {
    const double t = residual(cell) / (2 * scale);
    const double w = 1 / (1 + t * t);
    weight_[cell] = w * w;
  });
}

ContactVerdict ContactCheck::compare(const LumaGrid& then, const LumaGrid& now,
                                     const CellRegion& region, int degree,
                                     LightField& field) noexcept {
  // Start from the median ratio, which a press on less than half the field cannot move far.
  std::size_t count = 0;
  for_cells(region, [&](std::size_t cell) {
    scratch_[count++] = now.cells[cell] / std::max(then.cells[cell], 1.0F);
  });
  Terms terms{};
  if (count > 0) {
    const auto middle = scratch_.begin() + static_cast<std::ptrdiff_t>(count / 2);
    std::nth_element(scratch_.begin(), middle,
                     scratch_.begin() + static_cast<std::ptrdiff_t>(count));
    terms[0] = *middle;
  }
  const int terms_of_degree = (degree + 1) * (degree + 2) / 2;
  for (int round = 0; round < kRounds; ++round) {
    reweigh(then, now, region, terms);
    terms = solve(then, now, region, terms_of_degree);
  }

  for (std::size_t cell = 0; cell < kGridCells; ++cell) {
    field[cell] = std::clamp(static_cast<float>(dot(basis_[cell], terms)), 0.0625F, 16.0F);
  }
  float darkest = 0;
  float second = 0;
  int explained = 0;
  for_cells(region, [&](std::size_t cell) {
    const float expected = std::max(then.cells[cell] * field[cell], 1.0F);
    const float lacking = (expected - now.cells[cell]) / expected;
    explained += std::abs(lacking) < kExplained ? 1 : 0;
    if (lacking > darkest) {
      second = std::exchange(darkest, lacking);
    } else {
      second = std::max(second, lacking);
    }
  });
  return {second, count == 0 ? 0.0F : static_cast<float>(explained) / static_cast<float>(count)};
}

void relight(std::span<const std::uint16_t> then, int width, int height, const LightField& field,
             std::span<std::uint16_t> out) noexcept {
  struct Place {
    std::size_t low;
    float share;  // of the cell after `low`
  };
  const auto place = [](int pixel, int pixels, int cells) -> Place {
    const float at = (static_cast<float>(pixel) + 0.5F) * static_cast<float>(cells) /
                         static_cast<float>(pixels) -
                     0.5F;
    const float low = std::clamp(std::floor(at), 0.0F, static_cast<float>(cells - 2));
    return {static_cast<std::size_t>(low), std::clamp(at - low, 0.0F, 1.0F)};
  };
  for (int y = 0; y < height; ++y) {
    const Place row = place(y, height, kGridHeight);
    const float* upper = field.data() + row.low * kGridWidth;
    const float* lower = upper + kGridWidth;
    const std::size_t first = static_cast<std::size_t>(y) * static_cast<std::size_t>(width);
    for (int x = 0; x < width; ++x) {
      const Place column = place(x, width, kGridWidth);
      const auto blend = [&](const float* cells) {
        return cells[column.low] + column.share * (cells[column.low + 1] - cells[column.low]);
      };
      const float gain = blend(upper) + row.share * (blend(lower) - blend(upper));
      const std::size_t i = first + static_cast<std::size_t>(x);
      const float value = static_cast<float>(then[i]) * gain + 0.5F;
      out[i] = static_cast<std::uint16_t>(std::min(value, 65280.0F));
    }
  }
}

}  // namespace dtact::pipeline
