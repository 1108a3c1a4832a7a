#include "daemon/pipeline/depth/depth_maker.hpp"

#include <cmath>
#include <cstddef>

namespace dtact::pipeline {

DepthMaker::DepthMaker(const PipelineConfig& config, base::Clock& clock)
    : config_(config),
      clock_(clock),
      contact_(config.contact),
      chooser_(config.reconstruction.max_error_um) {}

void DepthMaker::use(Resolutions* maps, std::uint64_t generation) noexcept {
  maps_ = maps;
  generation_ = generation;
}

void DepthMaker::set_reference(std::span<const std::uint16_t> reference_q8) noexcept {
  maps_->set_reference(reference_q8);
}

void DepthMaker::set_light(double factor) noexcept { maps_->set_light(factor); }

void DepthMaker::skip(DepthFrame& out, ContactAbsence why) noexcept {
  beyond_ = false;
  out.has_depth = false;
  out.contact_absence = why;
  out.contact = {};
}

void DepthMaker::make(const hal::LumaView& luma, const UntouchedImage& untouched, bool judged,
                      DepthFrame& out) noexcept {
  Resolution& resolution = maps_->in_use();
  recon::Reconstructor& reconstructor = resolution.reconstructor;
  const recon::Model& model = reconstructor.model();
  out.has_depth = true;
  out.width = model.rectify.width;
  out.height = model.rectify.height;
  out.mm_per_px = model.mm_per_px;
  out.decimation = model.rectify.decimation;
  // Within the capacity reserved at start, so this allocates nothing.
  out.depth_um.resize(static_cast<std::size_t>(out.width) * static_cast<std::size_t>(out.height));
  // What another calibration or resolution drew in this buffer says nothing about this one's map.
  const bool another =
      out.drawn_generation != generation_ || out.drawn_decimation != out.decimation;
  if (another) out.drawn.rest = 0;
  out.drawn_generation = generation_;
  out.drawn_decimation = out.decimation;
  resolution.readers.mark(untouched.active(), resolution.tiles);
  recon::SumRules rules = contact_.sum_rules();
  if (judged || config_.reconstruction.decimation == 0) {
    rules.bend_reach = bend_reach(out.mm_per_px);
    rules.bend_from_um = rules.made_um;
  }
  recon::DepthSums sums(rules);
  recon::StepTimes steps;
  reconstructor.run_active(luma.data, luma.stride, resolution.tiles, out.depth_um, out.drawn,
                           &steps, &sums);
  out.times.rectify_ns = steps.rectify_ns;
  out.times.smooth_ns = steps.smooth_ns;
  out.times.list_ns = steps.list_ns;
  const std::int64_t began_ns = clock_.monotonic_ns();
  out.contact_um = rules.made_um;
  out.contact_absence = ContactAbsence::none;
  out.contact = contact_.inspect(sums, out.width, out.height, out.mm_per_px);
  contact_.weigh(model.force, out.contact);
  beyond_ = reconstructor.beyond_pixels() * out.decimation * out.decimation > config_.beyond_pixels;
  judge(untouched.trust(), bend_um(sums, out.mm_per_px), out);
  out.times.inspect_ns = steps.sums_ns + clock_.monotonic_ns() - began_ns;
}

/// What the map is worth, and at which resolution the next is made.
void DepthMaker::judge(const Trust& trust, double bend, DepthFrame& out) noexcept {
  // Half of the deepest is about the mean over a contact.
  double list_um = maps_->list_um(0.5 * out.contact.deepest_mm);
  if (trust.stale) list_um = std::hypot(list_um, kStaleReferenceUm);
  list_um = std::hypot(list_um, maps_->light_um(trust.light_left));
  list_um = std::hypot(list_um, maps_->light_um(trust.light_unseen));
  out.uncertainty_um = uncertainty_at_um(list_um, bend, out.decimation);
  if (config_.reconstruction.decimation == 0) {
    maps_->use_decimation(chooser_.next(list_um, bend));
  }
}

}  // namespace dtact::pipeline
