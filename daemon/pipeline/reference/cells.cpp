#include "daemon/pipeline/reference/cells.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace dtact::pipeline {
namespace {

namespace vec = recon::vec;

constexpr double kQ16 = 65536;
constexpr int kCell = vec::kCell;
/// Weight of a new frame in the noise's slow mean.
constexpr double kNoiseWeight = 1.0 / 64;
/// At least one cell in kQuietShare must be out of contact for the light to be seen beside a press.
constexpr int kQuietShare = 4;

std::int32_t q16(double levels) noexcept {
  return static_cast<std::int32_t>(std::lround(levels * kQ16));
}

}  // namespace

Cells::Cells(const recon::CellLattice& lattice, const CellSettings& settings)
    : lattice_(lattice),
      settings_(settings),
      sums_(lattice, settings.limits),
      margin_(static_cast<std::size_t>(lattice.stride()) + vec::kCellBlock) {
  const std::size_t cells = lattice_.at(0, lattice_.rows());
  for (auto* plane : {&taken_, &reference_, &drift_, &expected_, &cell_}) plane->resize(cells);
  for (auto* plane : {&change_, &window_, &active_}) plane->resize(cells + 2 * margin_);
  shares_.resize(cells);
}

void Cells::set_reference(std::span<const std::uint16_t> reference_q8) noexcept {
  for (int row = 0; row < lattice_.rows(); ++row) {
    for (int column = 0; column < lattice_.columns(); ++column) {
      std::int32_t sum = 0;
      const int y0 = lattice_.y_of(row);
      for (int y = y0; y < y0 + kCell; y += vec::kRowStep) {
        const auto line = reference_q8.subspan(
            static_cast<std::size_t>(y) * static_cast<std::size_t>(lattice_.frame_width()) +
                static_cast<std::size_t>(lattice_.x_of(column)),
            kCell);
        sum = std::accumulate(line.begin(), line.end(), sum);
      }
      taken_[lattice_.at(column, row)] = sum * (256 / vec::kCellPixels);  // Q8 to a mean in Q16
    }
  }
  for (auto* plane : {&drift_, &cell_, &window_, &active_}) std::ranges::fill(*plane, 0);
  mean_drift_ = 0;
  mean_reference_ = 0;
  active_cells_ = 0;
  sums_.restart();
  set_light(1);
}

void Cells::set_light(double factor) noexcept {
  const double before = mean_reference_;
  double sum = 0;
  for (std::size_t i = 0; i < taken_.size(); ++i) {
    reference_[i] = static_cast<std::int32_t>(std::lround(factor * taken_[i]));
    sum += reference_[i];
  }
  mean_reference_ = sum / kQ16 / std::max(1, lattice_.cells());
  // Drift is followed faster than the light, so it holds some of what the factor now says: that
  // would count twice.
  const double moved = mean_reference_ - before;
  const bool alike = (moved < 0) == (mean_drift_ < 0);
  const double counted =
      alike ? std::copysign(std::min(std::abs(moved), std::abs(mean_drift_)), moved) : 0;
  const double share = mean_reference_ > 0 ? counted / mean_reference_ : 0;
  for (std::size_t i = 0; i < drift_.size(); ++i) {
    set_drift(i, drift_[i] - share * reference_[i]);
  }
  mean_drift_ -= counted;
}

void Cells::set_drift(std::size_t i, double drift_q16) noexcept {
  const double limit = settings_.drift_limit * kQ16;
  drift_[i] = static_cast<std::int32_t>(std::lround(std::clamp(drift_q16, -limit, limit)));
  expected_[i] = reference_[i] + drift_[i];
}

vec::ChangeLimits Cells::limits() const noexcept {
  const auto limit = [this](double floor, double ceiling, double noise) {
    return q16(std::clamp(settings_.factor * noise, floor, ceiling));
  };
  const std::int32_t cell = limit(settings_.cell_floor, settings_.cell_ceiling, noise_);
  // A window's mean of four independent cells is half as noisy.
  const std::int32_t window = limit(settings_.window_floor, settings_.window_ceiling, noise_ / 2);
  return {cell, cell / 2, window, window / 2};
}

bool Cells::in_contact(int column, int row) const noexcept {
  // The planes' margins and padding are quiet.
  for (int y = row - 1; y <= row + 1; ++y) {
    for (int x = column - 1; x <= column + 1; ++x) {
      const std::ptrdiff_t i = std::ptrdiff_t{y} * lattice_.stride() + x;
      if (active_[static_cast<std::size_t>(static_cast<std::ptrdiff_t>(margin_) + i)] != 0) {
        return true;
      }
    }
  }
  return false;
}

void Cells::follow_drift() noexcept {
  const double step = settings_.drift_per_frame * kFollowEvery * kQ16;
  double total = 0;
  const auto move = [&](std::size_t i, double by) {
    const std::int32_t before = drift_[i];
    set_drift(i, before + by);
    total += drift_[i];
    return drift_[i] - before;
  };
  double moved = 0;
  int quiet = 0;
  for (int row = 0; row < lattice_.rows(); ++row) {
    for (int column = 0; column < lattice_.columns(); ++column) {
      const std::size_t i = lattice_.at(column, row);
      if (active_cells_ > 0 && in_contact(column, row)) continue;
      moved += move(i, std::clamp<double>(change_[margin_ + i], -step, step));
      ++quiet;
    }
  }
  // Light changes as a whole, so cells in contact follow the mean of the quiet ones, whatever they
  // show themselves. Otherwise drift would activate ring after ring around a press.
  const double common = 2 * quiet > lattice_.cells() ? moved / quiet : 0;
  for (int row = 0; row < lattice_.rows() && active_cells_ > 0; ++row) {
    for (int column = 0; column < lattice_.columns(); ++column) {
      if (in_contact(column, row)) (void)move(lattice_.at(column, row), common);
    }
  }
  mean_drift_ = total / lattice_.cells() / kQ16;
}

/// Most cells are active, yet the frame equals the reference in its light: the followed drift is
/// gone. Cells in contact would keep it for ever.
void Cells::forget_drift() noexcept {
  for (std::size_t i = 0; i < drift_.size(); ++i) set_drift(i, 0);
  mean_drift_ = 0;
}

LightSeen Cells::see_light(std::int32_t most, bool all_quiet, double quiet_change) noexcept {
  if (mean_reference_ <= 0) return {};
  if (all_quiet) {
    return {LightSeen::From::all, (quiet_change + mean_drift_) / mean_reference_};
  }
  // A light that changed enough to make any cell active makes most of them active.
  if (active_cells_ == 0 || 2 * active_cells_ >= lattice_.cells()) return from_all(most);
  return sums_.frames() % kFollowEvery == 0 ? from_quiet() : LightSeen{};
}

LightSeen Cells::from_all(std::int32_t most) const noexcept {
  std::int64_t total = 0;
  for (int row = 0; row < lattice_.rows(); ++row) {
    const std::int32_t* const from = &change_[margin_ + lattice_.at(0, row)];
    total = std::accumulate(from, from + lattice_.columns(), total);
  }
  const double change = static_cast<double>(total) / kQ16 / lattice_.cells();
  const auto factor = static_cast<float>(change / (mean_reference_ + mean_drift_));
  const auto limit = static_cast<float>(most);
  int unlike = 0;
  for (int row = 0; row < lattice_.rows(); ++row) {
    const std::int32_t* const changes = &change_[margin_ + lattice_.at(0, row)];
    const std::int32_t* const expected = &expected_[lattice_.at(0, row)];
    for (int i = 0; i < lattice_.columns(); ++i) {
      const float left = static_cast<float>(changes[i]) - factor * static_cast<float>(expected[i]);
      unlike += static_cast<int>(std::abs(left) > limit);
    }
  }
  if (unlike > 0) return {};
  return {LightSeen::From::all, (change + mean_drift_) / mean_reference_};
}

LightSeen Cells::from_quiet() noexcept {
  // The median: beside a press the gel bulges, by less than what is active but all one way.
  std::size_t quiet = 0;
  for (int row = 0; row < lattice_.rows(); ++row) {
    for (int column = 0; column < lattice_.columns(); ++column) {
      const std::size_t i = lattice_.at(column, row);
      if (reference_[i] <= 0 || in_contact(column, row)) continue;
      shares_[quiet++] =
          static_cast<float>(change_[margin_ + i] + drift_[i]) / static_cast<float>(reference_[i]);
    }
  }
  if (kQuietShare * quiet < static_cast<std::size_t>(lattice_.cells())) return {};
  const auto middle = shares_.begin() + static_cast<std::ptrdiff_t>(quiet / 2);
  std::nth_element(shares_.begin(), middle, shares_.begin() + static_cast<std::ptrdiff_t>(quiet));
  return {LightSeen::From::quiet, *middle};
}

CellReport Cells::look(const hal::LumaView& luma) noexcept {
  CellReport report;
  if (lattice_.empty()) return report;
  sums_.add(luma.data, luma.stride);
  const int cells = lattice_.cells();
  const int quiet = cells - active_cells_;
  const vec::ChangeLimits change_limits = limits();
  const vec::CellTotals totals =
      vec::compare_cells({lattice_.stride(), lattice_.rows(),
                          lattice_.columns() - (lattice_.last_column_overlaps() ? 2 : 1),
                          lattice_.rows() - (lattice_.last_row_overlaps() ? 2 : 1), sums_.now(),
                          sums_.before(), expected_.data(), change_.data() + margin_, cell_.data(),
                          window_.data() + margin_, active_.data() + margin_},
                         change_limits);
  active_cells_ = totals.active;
  const auto mean = [quiet](std::int64_t total) {
    return static_cast<double>(total) / std::max(1, quiet);
  };
  if (sums_.frames() > 1 && quiet > 0) {
    const double now = kFromDifference * mean(totals.quiet_step) / vec::kCellPixels;
    noise_ += (noise_ == 0 ? 1 : kNoiseWeight) * (now - noise_);
  }
  report.mean_grey = static_cast<double>(totals.grey) / cells / vec::kCellPixels;
  report.cell_noise = noise_;
  report.quiet_change = mean(totals.quiet_change) / 256;
  report.light =
      see_light(change_limits.cell_on, quiet == cells && active_cells_ == 0, report.quiet_change);
  const bool as_the_reference =
      report.light.from == LightSeen::From::all &&
      std::abs(report.light.change) * mean_reference_ < settings_.window_floor / 2;
  if (as_the_reference && 2 * active_cells_ >= cells) {
    forget_drift();
  } else if (sums_.frames() % kFollowEvery == 0) {
    follow_drift();
  }
  report.drift = mean_drift_;
  report.frame = sums_.statistics();
  report.cells = cells;
  report.active_cells = active_cells_;
  return report;
}

}  // namespace dtact::pipeline
