#include "daemon/recon/kernel_lut.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <span>

namespace dtact::recon {
namespace {

using kernels::Knots;

/// Heights of the knots whose straight lines are nearest to the entries, in least squares.
std::vector<double> fit(std::span<const std::int16_t> um, std::size_t step) {
  const std::size_t count = (um.size() - 1 + step - 1) / step + 1;
  // Each entry has a share in the two knots beside it: normal equations of three diagonals.
  std::vector<double> own(count);
  std::vector<double> next(count);
  std::vector<double> height(count);
  for (std::size_t i = 0; i < um.size(); ++i) {
    const std::size_t k = i / step;
    const double right = static_cast<double>(i % step) / static_cast<double>(step);
    const double left = 1 - right;
    own[k] += left * left;
    height[k] += left * um[i];
    if (right == 0) continue;
    own[k + 1] += right * right;
    next[k] += left * right;
    height[k + 1] += right * um[i];
  }
  for (std::size_t k = 1; k < count; ++k) {
    const double share = next[k - 1] / own[k - 1];
    own[k] -= share * next[k - 1];
    height[k] -= share * height[k - 1];
  }
  height.back() /= own.back();
  for (std::size_t k = count - 1; k-- > 0;)
    height[k] = (height[k] - next[k] * height[k + 1]) / own[k];
  return height;
}

/// Null where straight lines do not follow the entries, or there are too many or too great ones.
std::unique_ptr<const Knots> knots_of(std::span<const std::int16_t> um) {
  if (std::ranges::any_of(um, [](int v) { return std::abs(v) > Knots::kDeepestUm; }))
    return nullptr;
  const bool rises = std::ranges::is_sorted(um);
  auto knots = std::make_unique<Knots>();
  const auto holds = [&] { return um.size() <= (Knots::kCount - 1) * knots->step() + 1; };
  if (!holds()) knots->step_bits = 7;
  if (!holds()) return nullptr;
  int before = INT16_MIN;
  std::size_t count = 0;
  for (const double height : fit(um, knots->step())) {
    const double q3 = height * (1 << Knots::kFraction);
    if (std::abs(q3) > Knots::kDeepestUm << Knots::kFraction) return nullptr;
    // Rounding must not make a LUT fall that does not.
    const int at = std::max(static_cast<int>(std::lround(q3)), rises ? before : INT16_MIN);
    if (count > 0 && at - before > INT16_MAX) return nullptr;
    if (count > 0) knots->rise_q3[count - 1] = static_cast<std::int16_t>(at - before);
    knots->at_q3[count++] = static_cast<std::int16_t>(at);
    before = at;
  }
  double squares = 0;
  for (std::size_t i = 0; i < um.size(); ++i) {
    const double apart = kernels::between(*knots, static_cast<int>(i)) - um[i];
    squares += apart * apart;
  }
  const double rms = std::sqrt(squares / static_cast<double>(um.size()));
  return rms <= KernelLut::kKnotsWithinUm ? std::move(knots) : nullptr;
}

}  // namespace

KernelLut::KernelLut(const DepthLut& lut, Method method)
    : first_q6_(lut.first_q6), covered_q6_(lut.covered_to_q6), um_(lut.um) {
  if (method == Method::lut) {
    um_.resize(static_cast<std::size_t>(covered_q6_ - first_q6_) + 1);
    knots_ = knots_of(um_);
    if (knots_) {
      for (std::size_t i = 0; i < um_.size(); ++i) {
        um_[i] = kernels::between(*knots_, static_cast<int>(i));
      }
    }
    // Everything beyond the covered range looks up the marker: no comparison per pixel is needed.
    um_.push_back(kUntrusted);
  }
  um_.push_back(kUntrusted);
}

kernels::LutView KernelLut::view() const noexcept {
  return {um_.data(), first_q6_, first_q6_ + static_cast<int>(um_.size()) - 2, covered_q6_,
          knots_.get()};
}

}  // namespace dtact::recon
