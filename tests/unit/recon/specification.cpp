#include "tests/unit/recon/specification.hpp"

#include <algorithm>

#include "daemon/recon/kernels.hpp"
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

Specification::Specification(const Model& model)
    : model_(model), width_(model.rectify.width), height_(model.rectify.height), list_(model) {
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

Specification::Plane Specification::smooth(const Plane& in,
                                           std::span<const std::int16_t> taps) const {
  const int radius = static_cast<int>(taps.size()) - 1;
  const int padded = kernels::padded(width_);
  const auto row_of = [padded](Plane& plane, int y) {
    return plane.data() + std::ptrdiff_t{y} * padded;
  };
  Plane row(static_cast<std::size_t>(padded) + std::size_t{2} * kernels::kMaxRadius);
  Plane across(static_cast<std::size_t>(padded) * static_cast<std::size_t>(height_));
  for (int y = 0; y < height_; ++y) {
    std::int16_t* const middle = row.data() + kernels::kMaxRadius;
    for (int x = -radius; x < width_ + radius; ++x) {
      middle[x] = in[static_cast<std::size_t>(at(y) + std::clamp(x, 0, width_ - 1))];
    }
    kernels::smooth_horizontal_row(row.data() + kernels::kMaxRadius, taps, padded,
                                   row_of(across, y));
  }
  Plane out(in.size());
  Plane down(static_cast<std::size_t>(padded));
  std::vector<const std::int16_t*> rows(2 * taps.size() - 1);
  for (int y = 0; y < height_; ++y) {
    for (std::size_t k = 0; k < rows.size(); ++k) {
      rows[k] = row_of(across, std::clamp(y - radius + static_cast<int>(k), 0, height_ - 1));
    }
    kernels::smooth_vertical_row(rows.data(), taps, padded, down.data());
    std::copy_n(down.begin(), width_, out.begin() + at(y));
  }
  return out;
}

void Specification::set_reference(std::span<const std::uint16_t> reference_q8) {
  const std::vector<std::int16_t> taps =
      model_.method == Method::list ? gaussian_taps(model_.smoothing_px) : kPublishedTaps;
  reference_q6_ = rectify(reference_q8);
  const Plane calibration = smooth(rectify(model_.reference_q8), taps);
  const Plane now = smooth(reference_q6_, taps);
  gain_q12_.resize(reference_q6_.size());
  untrusted_ = model_.untrusted;
  untrusted_.resize(reference_q6_.size());
  kernels::gain_row(calibration.data(), now.data(), static_cast<int>(now.size()), gain_q12_.data(),
                    untrusted_.data());
  if (model_.method == Method::published) {
    for (std::int16_t& q6 : reference_q6_) q6 = static_cast<std::int16_t>((q6 + 32) / 64 * 64);
  }
}

Specification::Plane Specification::look_up(const Plane& in, const std::int16_t* gain,
                                            const std::uint8_t* untrusted) {
  Plane out(in.size());
  beyond_ = kernels::gain_list_mask_row(in.data(), gain, untrusted, list_.look_up(),
                                        static_cast<int>(in.size()), out.data());
  return out;
}

std::vector<std::int16_t> Specification::run(const std::uint8_t* luma, std::ptrdiff_t stride) {
  const Plane before = difference(luma, stride);
  if (model_.method == Method::list) {
    return look_up(smooth(before, gaussian_taps(model_.smoothing_px)), gain_q12_.data(),
                   untrusted_.data());
  }
  Plane depth = smooth(smooth(look_up(before, nullptr, nullptr), kPublishedTaps), kPublishedTaps);
  kernels::mask_row(untrusted_.data(), static_cast<int>(depth.size()), depth.data());
  return depth;
}

}  // namespace dtact::recon
