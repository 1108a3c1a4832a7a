#include "tests/accuracy/recon/double_pipeline.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace dtact::recon {
namespace {

using Plane = std::vector<double>;

struct Size {
  int width;
  int height;
};

double& at(Plane& plane, Size size, int x, int y) {
  return plane[static_cast<std::size_t>(y) * static_cast<std::size_t>(size.width) +
               static_cast<std::size_t>(x)];
}

template <typename Pixel>
Plane rectified(const RectifyTable& table, std::span<const Pixel> frame, double scale) {
  Plane out;
  for (const RectifyTable::Entry& e : table.entries) {
    const auto pixel = [&](int x, int y) {
      return scale *
             frame[static_cast<std::size_t>(y) * static_cast<std::size_t>(table.frame_width) +
                   static_cast<std::size_t>(x)];
    };
    out.push_back(std::lerp(std::lerp(pixel(e.x, e.y), pixel(e.x + 1, e.y), e.fx / 128.0),
                            std::lerp(pixel(e.x, e.y + 1), pixel(e.x + 1, e.y + 1), e.fx / 128.0),
                            e.fy / 128.0));
  }
  return out;
}

/// Gaussian cut at three standard deviations or `cut` of them, edges replicated.
Plane smoothed(Plane in, Size size, double sigma, double cut = 3) {
  const int radius = static_cast<int>(std::ceil(cut * sigma));
  Plane weight;
  double sum = 0;
  for (int k = -radius; k <= radius; ++k) {
    weight.push_back(sigma > 0 ? std::exp(-k * k / (2 * sigma * sigma)) : 1);
    sum += weight.back();
  }
  Plane across(in.size());
  Plane down(in.size());
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      for (int k = -radius; k <= radius; ++k) {
        at(across, size, x, y) += weight[static_cast<std::size_t>(k + radius)] / sum *
                                  at(in, size, std::clamp(x + k, 0, size.width - 1), y);
      }
    }
  }
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      for (int k = -radius; k <= radius; ++k) {
        at(down, size, x, y) += weight[static_cast<std::size_t>(k + radius)] / sum *
                                at(across, size, x, std::clamp(y + k, 0, size.height - 1));
      }
    }
  }
  return down;
}

double look_up(const DepthLut& lut, double level) {
  const double place = std::clamp(level * kEntriesPerLevel - lut.first_q6, 0.0,
                                  static_cast<double>(lut.um.size()) - 1);
  const auto low = static_cast<std::size_t>(place);
  const std::size_t high = std::min(low + 1, lut.um.size() - 1);
  return std::lerp(lut.um[low], lut.um[high], place - static_cast<double>(low));
}

/// x ← x + L − Hx, `steps` times, from x = L; H is two Gaussians, cut where they vanish.
Plane sharpened(const Model& model, const Plane& levels, Size size, int steps) {
  constexpr double kCut = 5;
  Plane x = levels;
  for (int i = 0; i < steps; ++i) {
    const Scattering& s = *model.scattering;
    const Plane narrow = smoothed(x, size, s.narrow_mm / model.mm_per_px, kCut);
    const Plane wide = smoothed(x, size, s.wide_mm / model.mm_per_px, kCut);
    for (std::size_t p = 0; p < x.size(); ++p) {
      x[p] += levels[p] - std::lerp(wide[p], narrow[p], s.narrow_weight);
    }
  }
  return x;
}

}  // namespace

std::vector<double> reconstruct_in_double(const Model& model,
                                          std::span<const std::uint16_t> reference_q8,
                                          std::span<const std::uint8_t> luma, int steps) {
  const Size size{model.rectify.width, model.rectify.height};
  const Plane then =
      smoothed(rectified<std::uint16_t>(model.rectify, model.reference_q8, 1 / 256.0), size,
               model.smoothing_px);
  const Plane reference = rectified(model.rectify, reference_q8, 1 / 256.0);
  const Plane now = smoothed(reference, size, model.smoothing_px);
  Plane difference = rectified(model.rectify, luma, 1.0);
  std::ranges::transform(reference, difference, difference.begin(), std::minus{});
  difference = smoothed(std::move(difference), size, model.smoothing_px);
  Plane level(difference.size());
  for (std::size_t i = 0; i < level.size(); ++i) level[i] = difference[i] * then[i] / now[i];
  level = sharpened(model, level, size, steps);
  const auto of_steps = std::ranges::find(model.sharpened, steps, &Model::Sharpened::steps);
  const DepthLut& lut = steps == 0 ? model.lut : of_steps->lut;
  Plane depth(difference.size());
  for (std::size_t i = 0; i < depth.size(); ++i) {
    const bool trusted = then[i] >= 8 && now[i] >= 8 && then[i] < 8 * now[i] &&
                         level[i] * kEntriesPerLevel <= lut.covered_to_q6;
    depth[i] = trusted ? look_up(lut, level[i]) : std::numeric_limits<double>::quiet_NaN();
  }
  return depth;
}

}  // namespace dtact::recon
