#include "daemon/recon/lit_reference.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "daemon/recon/kernels.hpp"
#include "daemon/recon/vector_kernels.hpp"

namespace dtact::recon {
namespace {

constexpr int kMaxDecimation = 4;

}  // namespace

// The authors call OpenCV's GaussianBlur with a 7×7 kernel and no sigma, which means this fixed
// table (getSmallGaussianKernel in its smooth.cpp): 1/32, 7/64, 7/32, 9/32, in Q14.
std::vector<std::int16_t> published_taps() { return {4608, 3584, 1792, 512}; }

std::vector<std::int16_t> taps_of(const Model& model) {
  return model.method == Method::lut ? gaussian_taps(model.smoothing_px) : published_taps();
}

LitReference::LitReference(std::shared_ptr<const Model> model)
    : model_(std::move(model)),
      width_(model_->rectify.width),
      height_(model_->rectify.height),
      stride_(static_cast<std::size_t>(vec::padded(width_))),
      smoother_(taps_of(*model_), width_, height_),
      in_(2, width_),
      out_(2, width_),
      fine_(model_->rectify.decimation, model_->rectify.fine_width()),
      calibration_q6_(at(height_)),
      taken_q6_(at(height_)),
      taken_gain_q12_(at(height_)),
      lit_q6_(at(height_)),
      lit_gain_q12_(at(height_)),
      marks_q12_(at(height_)),
      untrusted_(at(height_)) {
  rectify(model_->reference_q8);
  smooth(calibration_q6_);
  apply(model_->gain, {width_, height_, vec::padded(width_), model_->mm_per_px}, calibration_q6_);
  set(model_->reference_q8);
}

void LitReference::rectify(std::span<const std::uint16_t> reference_q8) noexcept {
  const RectifyTable& table = model_->rectify;
  std::array<const std::int16_t*, kMaxDecimation> rows{};
  for (int y = 0; y < height_; ++y) {
    for (int k = 0; k < table.decimation; ++k) {
      kernels::rectify_reference_row(
          reference_q8.data(), table.frame_width,
          table.entries.data() + std::ptrdiff_t{y * table.decimation + k} * table.fine_width(),
          table.fine_width(), fine_.row(k));
      rows[static_cast<std::size_t>(k)] = fine_.row(k);
    }
    kernels::average_reference_row(rows.data(), table.decimation, width_, taken_q6_.data() + at(y));
  }
}

void LitReference::smooth(std::span<std::int16_t> smoothed) noexcept {
  const int blocks = vec::padded(width_) / vec::kBlock;
  const auto copy_row = [this](const std::int16_t* from, std::int16_t* to) {
    std::copy_n(from, vec::padded(width_), to);
  };
  int pushed = 0;
  for (int pair = 0; pair < smoother_.pairs(); ++pair) {
    for (; pushed < std::min(smoother_.pairs(), pair + smoother_.reach() + 1); ++pushed) {
      copy_row(taken_q6_.data() + at(2 * pushed), in_.row(0));
      copy_row(taken_q6_.data() + at(std::min(2 * pushed + 1, height_ - 1)), in_.row(1));
      smoother_.push(pushed, in_.row(0), in_.row(1), 0, blocks);
    }
    smoother_.take(pair, out_.row(0), out_.row(1), 0, blocks);
    copy_row(out_.row(0), smoothed.data() + at(2 * pair));
    if (2 * pair + 1 < height_) copy_row(out_.row(1), smoothed.data() + at(2 * pair + 1));
  }
}

void LitReference::set(std::span<const std::uint16_t> reference_q8) noexcept {
  ++count_;
  rectify(reference_q8);
  // The gain's plane holds the smoothed reference until each of its rows is divided.
  smooth(taken_gain_q12_);
  for (int y = 0; y < height_; ++y) {
    std::uint8_t* const marks = untrusted_.data() + at(y);
    std::int16_t* const gain = taken_gain_q12_.data() + at(y);
    if (model_->untrusted.empty()) {
      std::fill_n(marks, width_, std::uint8_t{0});
    } else {
      std::copy_n(model_->untrusted.data() + std::ptrdiff_t{y} * width_, width_, marks);
    }
    kernels::gain_row(calibration_q6_.data() + at(y), gain, width_, gain, marks);
    for (int x = 0; x < width_; ++x) {
      if (marks[x] != 0) gain[x] = 0;
    }
  }
  if (model_->method == Method::published) {
    // The published method subtracts 8-bit images.
    for (std::int16_t& q6 : taken_q6_) q6 = static_cast<std::int16_t>((q6 + 32) / 64 * 64);
  }
  std::ranges::copy(taken_q6_, lit_q6_.begin());
  std::ranges::copy(taken_gain_q12_, lit_gain_q12_.begin());
  std::ranges::transform(lit_gain_q12_, marks_q12_.begin(), [](std::int16_t gain) {
    return static_cast<std::int16_t>(gain == 0 ? 0 : kernels::kGainOne);
  });
}

void LitReference::set_light(double factor) noexcept {
  if (model_->method == Method::published) return;
  const auto q15 = [](double f) {
    return static_cast<std::int32_t>(std::lround(f * kernels::kFactorOne));
  };
  const auto count = static_cast<int>(taken_q6_.size());
  kernels::scale_row(taken_q6_.data(), q15(factor), count, lit_q6_.data());
  kernels::scale_row(taken_gain_q12_.data(), q15(1 / factor), count, lit_gain_q12_.data());
}

}  // namespace dtact::recon
