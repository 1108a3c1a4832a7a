#include "tests/unit/recon/specification.hpp"

#include <algorithm>

#include "daemon/recon/kernels.hpp"
#include "daemon/recon/sharpener.hpp"
#include "daemon/recon/smoother.hpp"

namespace dtact::recon {
namespace {

const std::vector<std::int16_t> kPublishedTaps{4608, 3584, 1792, 512};

/// The rows of fine pixels that make one row of the map.
std::vector<const std::int16_t*> rows_of(const std::vector<std::int16_t>& fine,
                                         const RectifyTable& table) {
  std::vector<const std::int16_t*> rows(static_cast<std::size_t>(table.decimation));
  for (std::size_t k = 0; k < rows.size(); ++k) {
    rows[k] = fine.data() + k * static_cast<std::size_t>(table.fine_width());
  }
  return rows;
}

}  // namespace

Specification::Specification(const Model& model, int sharpen_steps)
    : model_(model),
      steps_(sharpen_steps),
      width_(model.rectify.width),
      height_(model.rectify.height),
      list_(steps_ == 0 ? model.lut
                        : std::ranges::find(model.sharpened, steps_, &Model::Sharpened::steps)->lut,
            model.method) {
  set_reference(model.reference_q8);
}

Specification::Plane Specification::rectify(std::span<const std::uint16_t> reference_q8) const {
  const RectifyTable& table = model_.rectify;
  Plane out(static_cast<std::size_t>(at(height_)));
  Plane fine(static_cast<std::size_t>(table.fine_width() * table.decimation));
  const std::vector<const std::int16_t*> rows = rows_of(fine, table);
  for (int y = 0; y < height_; ++y) {
    kernels::rectify_reference_row(
        reference_q8.data(), table.frame_width,
        table.entries.data() + std::ptrdiff_t{y} * table.decimation * table.fine_width(),
        static_cast<int>(fine.size()), fine.data());
    kernels::average_reference_row(rows.data(), table.decimation, width_, out.data() + at(y));
  }
  return out;
}

Specification::Plane Specification::difference(const std::uint8_t* luma,
                                               std::ptrdiff_t stride) const {
  const RectifyTable& table = model_.rectify;
  Plane out(static_cast<std::size_t>(at(height_)));
  for (int y = 0; y < height_; ++y) {
    const RectifyTable::Entry* entries =
        table.entries.data() + std::ptrdiff_t{y} * table.decimation * table.fine_width();
    if (table.decimation == 1) {
      kernels::rectify_difference_row(luma, stride, entries, reference_q6_.data() + at(y), width_,
                                      out.data() + at(y));
      continue;
    }
    kernels::rectify_mean_difference_row(luma, stride, entries, table.fine_width(),
                                         table.decimation, reference_q6_.data() + at(y), width_,
                                         out.data() + at(y));
  }
  return out;
}

Specification::Plane Specification::smooth(const Plane& in, int width, int height,
                                           std::span<const std::int16_t> taps) {
  const int radius = static_cast<int>(taps.size()) - 1;
  const int padded = kernels::padded(width);
  const auto row_of = [padded](Plane& plane, int y) {
    return plane.data() + std::ptrdiff_t{y} * padded;
  };
  const auto at = [width](int y) { return std::ptrdiff_t{y} * width; };
  Plane row(static_cast<std::size_t>(padded) + std::size_t{2} * kernels::kMaxRadius);
  Plane across(static_cast<std::size_t>(padded) * static_cast<std::size_t>(height));
  for (int y = 0; y < height; ++y) {
    std::int16_t* const middle = row.data() + kernels::kMaxRadius;
    for (int x = -radius; x < width + radius; ++x) {
      middle[x] = in[static_cast<std::size_t>(at(y) + std::clamp(x, 0, width - 1))];
    }
    kernels::smooth_horizontal_row(row.data() + kernels::kMaxRadius, taps, padded,
                                   row_of(across, y));
  }
  Plane out(in.size());
  Plane down(static_cast<std::size_t>(padded));
  std::vector<const std::int16_t*> rows(2 * taps.size() - 1);
  for (int y = 0; y < height; ++y) {
    for (std::size_t k = 0; k < rows.size(); ++k) {
      rows[k] = row_of(across, std::clamp(y - radius + static_cast<int>(k), 0, height - 1));
    }
    kernels::smooth_vertical_row(rows.data(), taps, padded, down.data());
    std::copy_n(down.begin(), width, out.begin() + at(y));
  }
  return out;
}

Specification::Plane Specification::sharpen(const Plane& level, const Plane& before) const {
  constexpr int kCoarse = kernels::kCoarse;
  const Plane narrow =
      smooth(before, width_, height_, Sharpener::narrow_taps(*model_.scattering, model_.mm_per_px));
  const int width = (width_ + kCoarse - 1) / kCoarse;
  const int height = (height_ + kCoarse - 1) / kCoarse;
  Plane means(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  for (int row = 0; row < height; ++row) {
    Plane fine[kCoarse];
    const std::int16_t* rows[kCoarse];
    for (int i = 0; i < kCoarse; ++i) {
      const std::ptrdiff_t from = at(std::min(kCoarse * row + i, height_ - 1));
      for (int x = 0; x < kCoarse * width; ++x) {
        fine[i].push_back(before[static_cast<std::size_t>(from + std::min(x, width_ - 1))]);
      }
      rows[i] = fine[i].data();
    }
    kernels::shrink_row(rows, width, means.data() + std::ptrdiff_t{row} * width);
  }
  means = smooth(means, width, height, Sharpener::wide_taps(*model_.scattering, model_.mm_per_px));
  // One column more on either side repeats the last one.
  const auto widened = [&](int row) {
    const auto from = means.begin() + std::ptrdiff_t{std::clamp(row, 0, height - 1)} * width;
    Plane out{*from};
    out.insert(out.end(), from, from + width);
    out.push_back(out.back());
    return out;
  };
  Plane after(level.size());
  for (int y = 0; y < height_; ++y) {
    const int in = y % kCoarse;
    const Plane near = widened(y / kCoarse);
    const Plane other = widened(in < kCoarse / 2 ? y / kCoarse - 1 : y / kCoarse + 1);
    const auto share = static_cast<std::int16_t>(in % 3 == 0 ? 12288 : 4096);  // 3/8, 1/8
    kernels::sharpen_row(level.data() + at(y), before.data() + at(y), narrow.data() + at(y),
                         {near.data() + 1, other.data() + 1, share},
                         Sharpener::wide_share_q15(*model_.scattering), width_,
                         after.data() + at(y));
  }
  return after;
}

void Specification::set_reference(std::span<const std::uint16_t> reference_q8) {
  const std::vector<std::int16_t> taps =
      model_.method == Method::lut ? gaussian_taps(model_.smoothing_px) : kPublishedTaps;
  reference_q6_ = rectify(reference_q8);
  const Plane calibration = smooth(rectify(model_.reference_q8), width_, height_, taps);
  const Plane now = smooth(reference_q6_, width_, height_, taps);
  gain_q12_.resize(reference_q6_.size());
  untrusted_ = model_.untrusted;
  untrusted_.resize(reference_q6_.size());
  kernels::gain_row(calibration.data(), now.data(), static_cast<int>(now.size()), gain_q12_.data(),
                    untrusted_.data());
  if (model_.method == Method::published) {
    for (std::int16_t& q6 : reference_q6_) q6 = static_cast<std::int16_t>((q6 + 32) / 64 * 64);
  }
}

Specification::Plane Specification::view(const Plane& in, const std::int16_t* gain,
                                         const std::uint8_t* untrusted) {
  Plane out(in.size());
  beyond_ = kernels::gain_lut_mask_row(in.data(), gain, untrusted, list_.view(),
                                       static_cast<int>(in.size()), out.data());
  return out;
}

std::vector<std::int16_t> Specification::run(const std::uint8_t* luma, std::ptrdiff_t stride) {
  const Plane before = difference(luma, stride);
  if (model_.method == Method::lut) {
    const Plane smoothed = smooth(before, width_, height_, gaussian_taps(model_.smoothing_px));
    if (steps_ == 0) return view(smoothed, gain_q12_.data(), untrusted_.data());
    std::vector<std::int16_t> gain = gain_q12_;
    for (std::size_t i = 0; i < gain.size(); ++i) gain[i] = untrusted_[i] != 0 ? 0 : gain[i];
    Plane level(smoothed.size());
    kernels::lit_row(smoothed.data(), gain.data(), static_cast<int>(gain.size()), level.data());
    Plane sharpened = level;
    for (int i = 0; i < steps_; ++i) sharpened = sharpen(level, sharpened);
    return view(sharpened, nullptr, untrusted_.data());
  }
  Plane depth = view(before, nullptr, nullptr);
  for (int i = 0; i < 2; ++i) depth = smooth(depth, width_, height_, kPublishedTaps);
  kernels::mask_row(untrusted_.data(), static_cast<int>(depth.size()), depth.data());
  return depth;
}

}  // namespace dtact::recon
