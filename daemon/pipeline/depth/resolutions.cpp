#include "daemon/pipeline/depth/resolutions.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numeric>
#include <utility>

#include "daemon/pipeline/depth/uncertainty.hpp"
#include "daemon/recon/decimate.hpp"

namespace dtact::pipeline {

Resolutions::Resolutions(const std::shared_ptr<const recon::Model>& model,
                         const recon::CellLattice& lattice, const ReconstructionRules& rules)
    : model_(model),
      mean_grey_(std::accumulate(model->reference_q8.begin(), model->reference_q8.end(), 0.0) /
                 256 / static_cast<double>(model->reference_q8.size())) {
  for (const int decimation : {1, 2, 4}) {
    if (rules.decimation != 0 && rules.decimation != decimation) continue;
    const auto of = decimation == 1
                        ? model
                        : std::make_shared<const recon::Model>(recon::decimate(*model, decimation));
    recon::Reconstructor reconstructor(of);
    recon::TileReaders readers(lattice, of->rectify, reconstructor.radius());
    recon::TileRows tiles(static_cast<std::size_t>(readers.grid().rows()));
    all_.push_back({std::move(reconstructor), std::move(readers), std::move(tiles)});
  }
}

void Resolutions::use_decimation(int decimation) noexcept {
  const auto found = std::ranges::find(all_, decimation, &Resolution::decimation);
  if (found != all_.end()) in_use_ = static_cast<std::size_t>(found - all_.begin());
}

void Resolutions::set_reference(std::span<const std::uint16_t> reference_q8) noexcept {
  for (Resolution& each : all_) each.reconstructor.set_reference(reference_q8);
}

void Resolutions::set_light(double factor) noexcept {
  for (Resolution& each : all_) each.reconstructor.set_light(factor);
}

double Resolutions::list_um(double depth_mm) const noexcept {
  const auto& rows = model_->uncertainty;
  if (rows.empty()) {
    // The radial gain is the published regression's alone.
    const bool published = model_->method == recon::Method::published ||
                           model_->gain.shape == recon::GainShape::radial;
    return published ? kUnstatedPublishedUm : kUnstatedListUm;
  }
  const auto above =
      std::ranges::lower_bound(rows, depth_mm, {}, &recon::Model::Uncertainty::depth_mm);
  if (above == rows.begin()) return rows.front().error_um;
  if (above == rows.end()) return rows.back().error_um;
  const auto below = above - 1;
  return std::lerp(below->error_um, above->error_um,
                   (depth_mm - below->depth_mm) / (above->depth_mm - below->depth_mm));
}

double Resolutions::light_um(double share) const noexcept {
  const recon::DepthList& list = model_->list;
  // The list's slope over the darkening of a light press; 20 grey levels are about 0.6 mm.
  constexpr int kLevels = 20;
  const auto at = [&](int level) {
    const int last = static_cast<int>(list.um.size()) - 1;
    const int i = std::clamp(level * recon::kEntriesPerLevel - list.first_q6, 0, last);
    return static_cast<double>(list.um[static_cast<std::size_t>(i)]);
  };
  return std::abs(share) * mean_grey_ * (at(kLevels) - at(0)) / kLevels;
}

}  // namespace dtact::pipeline
