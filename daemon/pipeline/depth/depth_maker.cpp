#include "daemon/pipeline/depth/depth_maker.hpp"

#include <array>
#include <cstddef>

namespace dtact::pipeline {

DepthMaker::DepthMaker(const PipelineConfig& config, base::Clock& clock)
    : config_(config), clock_(clock), contact_(config.contact) {}

void DepthMaker::use(Resolutions* maps, std::uint64_t generation) noexcept {
  maps_ = maps;
  if (maps_ != nullptr) chooser_ = ResolutionChooser(maps_->max_error_um());
  generation_ = generation;
}

void DepthMaker::set_reference(std::span<const std::uint16_t> reference_q8) noexcept {
  maps_->set_reference(reference_q8);
}

void DepthMaker::set_light(double factor) noexcept { maps_->set_light(factor); }

void DepthMaker::skip(DepthFrame& out, ContactAbsence why) noexcept {
  beyond_ = false;
  // Nobody has asked for contact, for hours perhaps: the next client begins without it.
  if (why == ContactAbsence::unasked) contact_ = ContactDetector(config_.contact);
  out.has_depth = false;
  out.contact_absence = why;
  out.contact = {};
}

void DepthMaker::make(const hal::LumaView& luma, const ReferenceTracker& tracker, bool judged,
                      DepthFrame& out) noexcept {
  Resolution& resolution = maps_->in_use();
  recon::Reconstructor& reconstructor = resolution.reconstructor;
  const recon::Model& model = reconstructor.model();
  const MapShape shape = maps_->shape();
  out.has_depth = true;
  out.width = shape.width;
  out.height = shape.height;
  out.mm_per_px = shape.mm_per_px;
  out.decimation = shape.decimation;
  out.made_decimation = resolution.decimation();
  out.sharpen_steps = resolution.steps();
  out.surface = model.surface;
  // Within the capacity reserved at start, so this allocates nothing.
  out.depth_um.resize(static_cast<std::size_t>(out.width) * static_cast<std::size_t>(out.height));
  // Marks left in this buffer by another calibration or resolution do not apply to this map.
  const bool another =
      out.drawn_generation != generation_ || out.drawn_resolution != maps_->resolution_index();
  if (another || resolution.coarse) out.drawn.rest = 0;
  out.drawn_generation = generation_;
  out.drawn_resolution = maps_->resolution_index();
  resolution.readers.mark(tracker.active(), resolution.tiles);
  recon::SumRules rules = contact_.sum_rules();
  if (judged || chooses() || resolution.force) {
    rules.bend_reach = bend_reach(model.mm_per_px);
    rules.bend_from_um = rules.threshold_um;
  }
  recon::DepthSums sums(rules);
  recon::StepTimes steps;
  reconstructor.run_active(
      luma.data, luma.stride, resolution.tiles,
      resolution.coarse ? std::span(resolution.coarse->depth_um) : std::span(out.depth_um),
      resolution.coarse ? resolution.coarse->drawn : out.drawn, &steps, &sums);
  const std::int64_t made_ns = clock_.monotonic_ns();
  if (resolution.coarse) {
    resolution.coarse->upsampler.run(resolution.coarse->depth_um, out.depth_um);
  }
  const std::int64_t began_ns = clock_.monotonic_ns();
  out.times.rectify_ns = steps.rectify_ns;
  out.times.smooth_ns = steps.smooth_ns;
  out.times.lut_ns = steps.lut_ns + began_ns - made_ns;
  out.contact_um = rules.threshold_um;
  out.contact_absence = ContactAbsence::none;
  out.contact = contact_.inspect(sums, model.rectify.width, model.rectify.height, model.mm_per_px,
                                 model.surface.view);
  const int beyond = reconstructor.beyond_pixels();
  beyond_ = beyond * out.made_decimation * out.made_decimation > config_.beyond_pixels;
  judge(tracker.trust(), bend_um(sums, model.mm_per_px) * rim_factor(sums.made, beyond), out);
  add_force(resolution, resolution.coarse ? resolution.coarse->depth_um : out.depth_um, beyond_,
            out.uncertainty_um, out.contact);
  out.times.inspect_ns = steps.sums_ns + clock_.monotonic_ns() - began_ns;
}

/// Estimates the map's uncertainty and chooses the resolution of the next map.
void DepthMaker::judge(const Trust& trust, double bend, DepthFrame& out) noexcept {
  const double plain_um = plain_bend_um(bend, out.sharpen_steps);
  const auto expected_um = [&](int decimation, int steps) {
    return uncertainty_at_um(maps_->contact_um(out.contact.deepest_mm, steps, trust), plain_um,
                             decimation, steps);
  };
  out.uncertainty_um = expected_um(out.made_decimation, out.sharpen_steps);
  if (!chooses()) return;
  std::array<double, Resolutions::kMaxResolutions> expected{};
  std::size_t resolutions = 0;
  for (const Resolution& each : maps_->resolutions()) {
    expected[resolutions++] = expected_um(each.decimation(), each.steps());
  }
  maps_->use(chooser_.next(std::span(expected).first(resolutions)));
}

}  // namespace dtact::pipeline
