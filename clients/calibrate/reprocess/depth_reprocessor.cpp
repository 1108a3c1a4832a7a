#include "clients/calibrate/reprocess/depth_reprocessor.hpp"

#include <algorithm>
#include <utility>

#include "clients/common/depth_message.hpp"
#include "daemon/pipeline/depth/uncertainty.hpp"

namespace dtact::reprocess {
namespace {

void set(v1::Frame& frame, v1::Health flag, bool on) {
  auto& health = *frame.mutable_health();
  health.erase(std::remove(health.begin(), health.end(), flag), health.end());
  if (on) health.Add(flag);
}

}  // namespace

bool has(const v1::Frame& frame, v1::Health flag) {
  return std::ranges::find(frame.health(), flag) != frame.health().end();
}

DepthReprocessor::DepthReprocessor(std::shared_ptr<const calibration::Calibration> calibration)
    : calibration_(std::move(calibration)),
      image_(calibration_),
      steps_(recon::sharpening_steps(*calibration_->model)),
      follower_(pipeline::DriftRules{}),
      contact_(pipeline::ContactRules{}) {}

void DepthReprocessor::set_reference(std::span<const std::uint16_t> reference_q8, double light) {
  light_ = light;
  reference_q8_.assign(reference_q8.begin(), reference_q8.end());
  image_.cells.set_reference(reference_q8);
  follower_.restart(calibration_->model->method == recon::Method::lut);
  for (auto& [variant, maps] : maps_) maps.set_reference(reference_q8);
  light_now_ = 1;
  if (light != 1) set_light(light);
}

void DepthReprocessor::set_light(double factor) {
  light_now_ = factor;
  image_.cells.set_light(factor);
  for (auto& [variant, maps] : maps_) maps.set_light(factor);
}

void DepthReprocessor::follow_light(const pipeline::LightSeen& light, std::int64_t timestamp_ns) {
  if (const auto factor = follower_.look(light, timestamp_ns)) set_light(light_ * *factor);
}

pipeline::Resolutions& DepthReprocessor::maps_for(const MapVariant& variant) {
  if (const auto found = maps_.find(variant); found != maps_.end()) return found->second;
  pipeline::Resolutions maps(calibration_->model, image_.cells.lattice(),
                             {.decimation = variant.decimation, .sharpen = variant.steps});
  if (!reference_q8_.empty()) maps.set_reference(reference_q8_);
  if (light_now_ != 1) maps.set_light(light_now_);
  return maps_.emplace(variant, std::move(maps)).first->second;
}

void DepthReprocessor::remake(const hal::LumaView& luma, v1::Frame& frame) {
  const auto seen = image_.cells.look(luma);
  if (!has(frame, v1::HEALTH_REFERENCE_RESTORED)) follow_light(seen.light, frame.monotonic_ns());

  MapVariant variant;
  if (frame.has_depth()) {
    const auto decimation = static_cast<int>(frame.depth().decimation());
    variant = {decimation == 2 || decimation == 4 ? decimation : 1,
               static_cast<int>(frame.depth().sharpen_steps())};
  }
  if (variant.steps != 0 && std::ranges::find(steps_, variant.steps) == steps_.end()) {
    variant.steps = 0;
    ++unsharpened_;
  }
  pipeline::Resolutions& maps = maps_for(variant);
  pipeline::Resolution& resolution = maps.in_use();
  const recon::Model& model = resolution.reconstructor.model();
  const pipeline::MapShape shape = maps.shape();
  depth_um_.resize(static_cast<std::size_t>(shape.width) * static_cast<std::size_t>(shape.height));
  if (std::exchange(drawn_variant_, variant) != variant || resolution.coarse) drawn_.rest = 0;
  resolution.readers.mark(image_.cells.active(), resolution.tiles);
  recon::SumRules rules = contact_.sum_rules();
  rules.bend_reach = pipeline::bend_reach(model.mm_per_px);
  rules.bend_from_um = rules.threshold_um;
  recon::DepthSums sums(rules);
  resolution.reconstructor.run_active(
      luma.data, luma.stride, resolution.tiles,
      resolution.coarse ? std::span(resolution.coarse->depth_um) : std::span(depth_um_),
      resolution.coarse ? resolution.coarse->drawn : drawn_, nullptr, &sums);
  if (resolution.coarse) {
    resolution.coarse->upsampler.run(resolution.coarse->depth_um, depth_um_);
  }
  summary_ = contact_.inspect(sums, model.rectify.width, model.rectify.height, model.mm_per_px,
                              model.surface.view);
  cli::set_surface(model.surface, frame);

  v1::DepthMap map;
  map.set_encoding(v1::DEPTH_PREDICT_ZSTD);
  map.set_width(static_cast<std::uint32_t>(shape.width));
  map.set_height(static_cast<std::uint32_t>(shape.height));
  map.set_full_width(map.width());
  map.set_full_height(map.height());
  map.set_mm_per_px(shape.mm_per_px);
  map.set_um_per_unit(1);
  map.set_untrusted_value(recon::kUntrusted);
  map.set_decimation(static_cast<std::uint32_t>(shape.decimation));
  map.set_sharpen_steps(static_cast<std::uint32_t>(variant.steps));
  if (resolution.coarse) {
    map.set_made_decimation(static_cast<std::uint32_t>(resolution.decimation()));
  }
  encoder_.encode(depth_um_, map.width(), *map.mutable_data());
  *frame.mutable_depth() = std::move(map);
  describe(sums, maps, resolution, frame);
}

void DepthReprocessor::describe(const recon::DepthSums& sums, const pipeline::Resolutions& maps,
                                pipeline::Resolution& resolution, v1::Frame& frame) {
  const pipeline::Trust trust{.light_left = follower_.left(), .light_unseen = follower_.unseen()};
  const int made = resolution.decimation();
  const int steps = resolution.steps();
  const int beyond_pixels = resolution.reconstructor.beyond_pixels();
  const double bend_um = pipeline::bend_um(sums, resolution.reconstructor.model().mm_per_px) *
                         pipeline::rim_factor(sums.made, beyond_pixels);
  const double uncertainty_um =
      pipeline::uncertainty_at_um(maps.contact_um(summary_.deepest_mm, steps, trust),
                                  pipeline::plain_bend_um(bend_um, steps), made, steps);
  const bool beyond = beyond_pixels * made * made > pipeline::PipelineConfig{}.beyond_pixels;
  pipeline::add_force(
      resolution, resolution.coarse ? std::span(resolution.coarse->depth_um) : std::span(depth_um_),
      beyond, uncertainty_um, summary_);
  frame.mutable_depth()->set_uncertainty_um(uncertainty_um);
  auto& contact = *frame.mutable_contact();
  contact.set_in_contact(summary_.in_contact);
  contact.set_threshold_mm(summary_.threshold_mm);
  contact.set_area_mm2(summary_.area_mm2);
  contact.set_x_mm(summary_.x_mm);
  contact.set_y_mm(summary_.y_mm);
  contact.set_deepest_mm(summary_.deepest_mm);
  contact.set_deepest_x_mm(summary_.deepest_x_mm);
  contact.set_deepest_y_mm(summary_.deepest_y_mm);
  contact.set_volume_mm3(summary_.volume_mm3);
  contact.clear_force_n();
  contact.clear_force_uncertainty_n();
  contact.set_force_absence(static_cast<v1::ForceAbsence>(summary_.force_absence));
  if (summary_.force) {
    contact.set_force_n(summary_.force->newtons);
    contact.set_force_uncertainty_n(summary_.force->uncertainty_n);
  }
  frame.clear_contact_absence();
  frame.clear_calibration();  // the daemon has no number for it
  frame.clear_times();
  set(frame, v1::HEALTH_UNCALIBRATED, false);
  set(frame, v1::HEALTH_BEYOND_CALIBRATION, beyond);
}

}  // namespace dtact::reprocess
