#include "daemon/pipeline/depth/resolutions.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <stdexcept>
#include <string>
#include <utility>

#include "daemon/pipeline/depth/uncertainty.hpp"
#include "daemon/recon/kernels.hpp"
#include "daemon/recon/model.hpp"

namespace dtact::pipeline {
namespace {

void require_sharpening(const recon::Model& model, int steps) {
  const auto found = std::ranges::find(model.sharpened, steps, &recon::Model::Sharpened::steps);
  if (found != model.sharpened.end()) return;
  throw std::invalid_argument(
      "reconstruction.sharpen is " + std::to_string(steps) +
      ", but the calibration has no LUT for levels sharpened so often: calibrate with --method "
      "model, or set reconstruction.sharpen to \"auto\" or \"off\"");
}

/// Mean grey of the reference over the map's lit, trusted pixels. Housing beside the map and a
/// dark corner in it have no depth, so light cannot change it there.
double mean_grey_of(const recon::Model& model) {
  constexpr int kDarkest_q8 = 4 * recon::kernels::kDarkest_q6;
  const recon::RectifyTable& map = model.rectify;
  double sum = 0;
  double count = 0;
  for (std::size_t i = 0; i < map.entries.size(); ++i) {
    const recon::RectifyTable::Entry& at = map.entries[i];
    const std::uint16_t q8 = model.reference_q8[static_cast<std::size_t>(at.y) *
                                                    static_cast<std::size_t>(map.frame_width) +
                                                static_cast<std::size_t>(at.x)];
    if (q8 < kDarkest_q8 || (!model.untrusted.empty() && model.untrusted[i] != 0)) continue;
    sum += q8;
    count += 1;
  }
  return count > 0 ? sum / 256 / count : 0;
}

}  // namespace

void add_force(Resolution& resolution, std::span<const std::int16_t> depth_um, bool beyond,
               double uncertainty_um, ContactSummary& contact) noexcept {
  contact.force.reset();
  contact.force_absence = recon::ForceAbsence::none;
  if (!resolution.force) {
    contact.force_absence = recon::ForceAbsence::uncalibrated;
  } else if (beyond) {
    contact.force_absence = recon::ForceAbsence::beyond_calibration;
  } else if (!contact.in_contact) {
    contact.force = resolution.force->none();
  } else {
    const auto read = resolution.force->read(depth_um, resolution.tiles, uncertainty_um / 1000);
    contact.force = read.force;
    contact.force_absence = read.absence;
  }
}

Resolutions::Resolutions(const std::shared_ptr<const recon::Model>& model,
                         const recon::CellLattice& lattice, const ReconstructionRules& rules)
    : model_(model), max_error_um_(rules.max_error_um), mean_grey_(mean_grey_of(*model)) {
  // Without another request a sharpened map keeps the resolution at which it is made.
  const int finest = model->frame_scale;
  const int asked = rules.decimation == 0 ? 0 : std::max(finest, rules.decimation);
  const int map = asked == 0 ? recon::kSharpenedAt : asked;
  if (rules.sharpen > 0) {
    require_sharpening(*model, rules.sharpen);
    add(lattice, recon::kSharpenedAt, rules.sharpen, map);
    return;
  }
  std::vector<int> steps;
  if (rules.sharpen == ReconstructionRules::kAutoSharpen) steps = recon::sharpening_steps(*model);
  if (!steps.empty()) {
    // The resolution without steps is as coarse as the others: plain at full resolution costs more.
    add(lattice, recon::kSharpenedAt, 0, map);
    for (const int each : steps) add(lattice, recon::kSharpenedAt, each, map);
  } else if (asked != 0) {
    add(lattice, asked, 0, asked);
  } else {
    for (const int each : {4, 2, 1}) {
      if (each >= finest) add(lattice, each, 0, each);
    }
  }
}

void Resolutions::add(const recon::CellLattice& lattice, int decimation, int steps,
                      int map_decimation) {
  const int factor = decimation / model_->frame_scale;
  const auto of =
      factor == 1 ? model_ : std::make_shared<const recon::Model>(recon::decimate(*model_, factor));
  recon::Reconstructor reconstructor(of, steps);
  recon::TileReaders readers(lattice, of->rectify, reconstructor.radius());
  recon::TileRows tiles(static_cast<std::size_t>(readers.grid().rows()));
  std::optional<recon::ForceMeter> force;
  if (const auto& law = of->force) {
    force.emplace(*law, of->rectify.width, of->rectify.height, of->mm_per_px);
  }
  all_.push_back(
      {std::move(reconstructor), std::move(readers), std::move(tiles), {}, std::move(force)});
  if (map_decimation == decimation) return;
  all_.back().coarse = {
      .upsampler = recon::Upsampler(model_->rectify.width, model_->rectify.height, factor,
                                    map_decimation / model_->frame_scale),
      .depth_um = std::vector<std::int16_t>(static_cast<std::size_t>(of->rectify.width) *
                                            static_cast<std::size_t>(of->rectify.height)),
      .drawn = {}};
}

MapShape Resolutions::shape() const noexcept {
  const Resolution& now = all_[in_use_];
  const recon::RectifyTable& table = now.reconstructor.model().rectify;
  if (!now.coarse) {
    return {table.width, table.height, now.decimation(), now.reconstructor.model().mm_per_px};
  }
  const recon::Upsampler& to = now.coarse->upsampler;
  return {to.width(), to.height(), to.decimation() * model_->frame_scale,
          model_->mm_per_px * to.decimation()};
}

void Resolutions::set_reference(std::span<const std::uint16_t> reference_q8) noexcept {
  for (Resolution& each : all_) each.reconstructor.set_reference(reference_q8);
}

void Resolutions::set_light(double factor) noexcept {
  for (Resolution& each : all_) each.reconstructor.set_light(factor);
}

double Resolutions::lut_um(double depth_mm, int steps) const noexcept {
  const auto of_steps =
      std::ranges::find(model_->sharpened, steps, &recon::Model::Sharpened::steps);
  const auto& rows =
      of_steps == model_->sharpened.end() ? model_->uncertainty : of_steps->uncertainty;
  if (rows.empty()) {
    // Only the published regression uses the radial gain.
    const bool published = model_->method == recon::Method::published ||
                           model_->gain.shape == recon::GainShape::radial;
    return published ? kDefaultPublishedUncertaintyUm : kDefaultLutUncertaintyUm;
  }
  const auto above =
      std::ranges::lower_bound(rows, depth_mm, {}, &recon::Model::Uncertainty::depth_mm);
  if (above == rows.begin()) return rows.front().error_um;
  if (above == rows.end()) return rows.back().error_um;
  const auto below = above - 1;
  return std::lerp(below->error_um, above->error_um,
                   (depth_mm - below->depth_mm) / (above->depth_mm - below->depth_mm));
}

double Resolutions::contact_um(double deepest_mm, int steps, const Trust& trust) const noexcept {
  double um = lut_um(0.5 * deepest_mm, steps);
  if (trust.stale) um = std::hypot(um, kStaleReferenceUm);
  um = std::hypot(um, light_um(trust.light_left));
  return std::hypot(um, light_um(trust.light_unseen));
}

double Resolutions::light_um(double share) const noexcept {
  const recon::DepthLut& lut = model_->lut;
  // The LUT's slope over the darkening of a light press; 20 grey levels are about 0.6 mm.
  constexpr int kLevels = 20;
  const auto at = [&](int level) {
    const int last = static_cast<int>(lut.um.size()) - 1;
    const int i = std::clamp(level * recon::kEntriesPerLevel - lut.first_q6, 0, last);
    return static_cast<double>(lut.um[static_cast<std::size_t>(i)]);
  };
  return std::abs(share) * mean_grey_ * (at(kLevels) - at(0)) / kLevels;
}

}  // namespace dtact::pipeline
