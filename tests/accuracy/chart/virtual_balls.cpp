#include "tests/accuracy/chart/virtual_balls.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "daemon/recon/model.hpp"
#include "daemon/recon/reconstructor.hpp"
#include "hal/sim/scene.hpp"
#include "tests/accuracy/chart/scenes.hpp"

namespace dtact::chart {
namespace {

constexpr int kDecimation = 4;
constexpr int kCoarseSide = kSide / kDecimation;
constexpr int kFrames = 4;
constexpr int kReach_q6 = 255 * recon::kEntriesPerLevel;

std::vector<Shot> virtual_presses() {
  std::vector<Shot> shots;
  for (const double radius_mm : {1.5, 2.5, 4.0, 6.0, 8.0}) {
    for (const double depth_mm : {0.4, 0.9, 1.4}) {
      const auto i = static_cast<double>(shots.size());
      shots.push_back(shoot(
          "virtual ball",
          fmt::format("[[press]]\nobject = \"ball\"\nradius_mm = {}\nkeys = [ {{ t = 0.1, x = {}, "
                      "y = {}, depth = 0.0 }}, {{ t = 0.5, depth = {} }} ]\n",
                      radius_mm, 0.31 * i - 2.2, 1.9 - 0.27 * i, depth_mm),
          kFrames));
    }
  }
  return shots;
}

/// A LUT that returns levels in Q6 in place of depth.
recon::DepthLut levels_lut() {
  recon::DepthLut lut{
      .first_q6 = -kReach_q6, .um = {}, .covered_from_q6 = -kReach_q6, .covered_to_q6 = kReach_q6};
  for (int q6 = -kReach_q6; q6 <= kReach_q6; ++q6) lut.um.push_back(static_cast<std::int16_t>(q6));
  return lut;
}

/// Level and true indentation of one pixel.
struct Pair {
  double q6 = 0;
  double um = 0;
};

std::vector<Pair> read_levels(const std::shared_ptr<const recon::Model>& levels, int steps,
                              const image::Grey16& reference, const std::vector<Shot>& shots) {
  recon::Reconstructor reconstructor(levels, steps);
  reconstructor.set_reference(reference.pixels);
  std::vector<Pair> pairs;
  std::vector<std::int16_t> q6(std::size_t{kCoarseSide} * kCoarseSide);
  for (const Shot& shot : shots) {
    std::vector<double> sums(q6.size());
    for (const image::Grey8& frame : shot.frames) {
      std::vector<std::uint8_t> luma = frame.pixels;
      luma.resize(luma.size() + recon::kLumaPadding);
      reconstructor.run(luma.data(), kWidth, q6);
      for (std::size_t i = 0; i < q6.size(); ++i) sums[i] += q6[i];
    }
    for (int y = 0; y < kCoarseSide; ++y) {
      for (int x = 0; x < kCoarseSide; ++x) {
        double mm = 0;
        for (int k = 0; k < kDecimation * kDecimation; ++k) {
          mm += double{
              shot.truth_mm[static_cast<std::size_t>(y * kDecimation + k / kDecimation) * kSide +
                            static_cast<std::size_t>(x * kDecimation + k % kDecimation)]};
        }
        pairs.push_back({sums[static_cast<std::size_t>(y * kCoarseSide + x)] / kFrames,
                         1000 * mm / (kDecimation * kDecimation)});
      }
    }
  }
  return pairs;
}

/// Means over a grey level each, straight lines between them, never falling.
recon::DepthLut list_of(std::vector<Pair> pairs) {
  constexpr int kMin = 30;
  std::ranges::sort(pairs, {}, &Pair::q6);
  std::vector<Pair> nodes;
  for (auto from = pairs.begin(); from != pairs.end();) {
    const double end_q6 =
        (std::floor(from->q6 / recon::kEntriesPerLevel) + 1) * recon::kEntriesPerLevel;
    const auto to = std::ranges::lower_bound(from, pairs.end(), end_q6, {}, &Pair::q6);
    Pair mean;
    for (auto it = from; it != to; ++it) {
      mean.q6 += it->q6 / static_cast<double>(to - from);
      mean.um += it->um / static_cast<double>(to - from);
    }
    // Depths beside zero are noise, and zero is known.
    if (to - from >= kMin && std::abs(mean.q6) > recon::kEntriesPerLevel) nodes.push_back(mean);
    from = to;
  }
  nodes.push_back({});
  std::ranges::sort(nodes, {}, &Pair::q6);
  for (std::size_t i = 1; i < nodes.size(); ++i) {
    nodes[i].um = std::max(nodes[i].um, nodes[i - 1].um);
  }
  recon::DepthLut lut;
  lut.first_q6 = static_cast<int>(std::ceil(nodes.front().q6));
  const int last = static_cast<int>(std::floor(nodes.back().q6));
  auto right = nodes.begin() + 1;
  for (int q6 = lut.first_q6; q6 <= last; ++q6) {
    while (right->q6 < q6) ++right;
    const Pair& left = *(right - 1);
    const double um = std::lerp(left.um, right->um, (q6 - left.q6) / (right->q6 - left.q6));
    lut.um.push_back(static_cast<std::int16_t>(std::lround(um)));
  }
  lut.covered_from_q6 = lut.first_q6;
  lut.covered_to_q6 = last;
  return lut;
}

/// Mean absolute error of the balls' own pixels, a quarter of a millimetre each.
std::vector<recon::Model::Uncertainty> uncertainty_of(const recon::DepthLut& lut,
                                                      const std::vector<Pair>& pairs) {
  constexpr double kStep_um = 250;
  std::vector<double> sums;
  std::vector<double> counts;
  for (const Pair& pair : pairs) {
    if (pair.um < 50) continue;
    const auto bin = static_cast<std::size_t>(pair.um / kStep_um);
    if (bin >= sums.size()) {
      sums.resize(bin + 1);
      counts.resize(bin + 1);
    }
    const int at = std::clamp(static_cast<int>(std::lround(pair.q6)) - lut.first_q6, 0,
                              static_cast<int>(lut.um.size()) - 1);
    sums[bin] += std::abs(lut.um[static_cast<std::size_t>(at)] - pair.um);
    ++counts[bin];
  }
  std::vector<recon::Model::Uncertainty> rows;
  for (std::size_t bin = 0; bin < sums.size(); ++bin) {
    if (counts[bin] == 0) continue;
    rows.push_back({(static_cast<double>(bin) + 0.5) * kStep_um / 1000, sums[bin] / counts[bin]});
  }
  return rows;
}

}  // namespace

recon::Model with_luts_of_virtual_balls(recon::Model model, const image::Grey16& reference) {
  const hal::sim::OpticsModel& optics = hal::sim::default_scene().optics;
  model.scattering = recon::Scattering{.narrow_mm = optics.narrow_mm,
                                       .wide_mm = optics.wide_mm,
                                       .narrow_weight = optics.narrow_weight};
  recon::Model levels = recon::decimate(model, kDecimation);
  levels.lut = levels_lut();
  levels.sharpened = {{.steps = 1, .lut = levels.lut, .uncertainty = {}},
                      {.steps = 2, .lut = levels.lut, .uncertainty = {}}};
  const auto shared = std::make_shared<const recon::Model>(std::move(levels));
  const std::vector<Shot> shots = virtual_presses();
  model.sharpened.clear();
  for (const int steps : {0, 1, 2}) {
    const std::vector<Pair> pairs = read_levels(shared, steps, reference, shots);
    const recon::DepthLut lut = list_of(pairs);
    const auto uncertainty = uncertainty_of(lut, pairs);
    if (steps == 0) {
      model.lut = lut;
      model.uncertainty = uncertainty;
    } else {
      model.sharpened.push_back({.steps = steps, .lut = lut, .uncertainty = uncertainty});
    }
  }
  return model;
}

}  // namespace dtact::chart
