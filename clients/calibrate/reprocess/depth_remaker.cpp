#include "clients/calibrate/reprocess/depth_remaker.hpp"

#include <algorithm>
#include <utility>

#include "daemon/pipeline/depth/uncertainty.hpp"

namespace dtact::reprocess {
namespace {

/// All resolutions: the recorded map says which.
constexpr pipeline::ReconstructionRules kEveryResolution{.decimation = 0};

void set(v1::Frame& frame, v1::Health condition, bool on) {
  auto& health = *frame.mutable_health();
  health.erase(std::remove(health.begin(), health.end(), condition), health.end());
  if (on) health.Add(condition);
}

}  // namespace

bool has(const v1::Frame& frame, v1::Health condition) {
  return std::ranges::find(frame.health(), condition) != frame.health().end();
}

DepthRemaker::DepthRemaker(std::shared_ptr<const calibration::Calibration> calibration)
    : calibration_(std::move(calibration)),
      image_(calibration_),
      maps_(calibration_->model, image_.cells.lattice(), kEveryResolution),
      follower_(pipeline::DriftRules{}),
      contact_(pipeline::ContactRules{}) {}

void DepthRemaker::set_reference(std::span<const std::uint16_t> reference_q8, double light) {
  light_ = light;
  image_.cells.set_reference(reference_q8);
  follower_.restart(calibration_->model->method == recon::Method::list);
  maps_.set_reference(reference_q8);
  if (light == 1) return;
  image_.cells.set_light(light);
  maps_.set_light(light);
}

void DepthRemaker::follow_light(const pipeline::LightSeen& light, std::int64_t timestamp_ns) {
  const auto factor = follower_.look(light, timestamp_ns);
  if (!factor) return;
  image_.cells.set_light(light_ * *factor);
  maps_.set_light(light_ * *factor);
}

void DepthRemaker::remake(const hal::LumaView& luma, v1::Frame& frame) {
  const auto seen = image_.cells.look(luma);
  if (!has(frame, v1::HEALTH_REFERENCE_RESTORED)) follow_light(seen.light, frame.monotonic_ns());

  const int decimation =
      frame.has_depth() ? std::max(1, static_cast<int>(frame.depth().decimation())) : 1;
  if (const auto rung = maps_.find(decimation, 0)) maps_.use(*rung);
  pipeline::Resolution& resolution = maps_.in_use();
  const recon::Model& model = resolution.reconstructor.model();
  depth_um_.resize(model.rectify.entries.size());
  if (std::exchange(drawn_decimation_, decimation) != decimation) drawn_.rest = 0;
  resolution.readers.mark(image_.cells.active(), resolution.tiles);
  recon::SumRules rules = contact_.sum_rules();
  rules.bend_reach = pipeline::bend_reach(model.mm_per_px);
  rules.bend_from_um = rules.made_um;
  recon::DepthSums sums(rules);
  resolution.reconstructor.run_active(luma.data, luma.stride, resolution.tiles, depth_um_, drawn_,
                                      nullptr, &sums);
  summary_ = contact_.inspect(sums, model.rectify.width, model.rectify.height, model.mm_per_px);
  contact_.weigh(model.force, resolution.steps(), summary_);

  v1::DepthMap map;
  map.set_encoding(v1::DEPTH_PREDICT_ZSTD);
  map.set_width(static_cast<std::uint32_t>(model.rectify.width));
  map.set_height(static_cast<std::uint32_t>(model.rectify.height));
  map.set_full_width(map.width());
  map.set_full_height(map.height());
  map.set_mm_per_px(model.mm_per_px);
  map.set_um_per_unit(1);
  map.set_untrusted_value(recon::kUntrusted);
  map.set_decimation(static_cast<std::uint32_t>(decimation));
  encoder_.encode(depth_um_, map.width(), *map.mutable_data());
  *frame.mutable_depth() = std::move(map);
  describe(sums,
           resolution.reconstructor.beyond_pixels() * decimation * decimation >
               pipeline::PipelineConfig{}.beyond_pixels,
           frame);
}

void DepthRemaker::describe(const recon::DepthSums& sums, bool beyond, v1::Frame& frame) const {
  const pipeline::Trust trust{.light_left = follower_.left(), .light_unseen = follower_.unseen()};
  frame.mutable_depth()->set_uncertainty_um(
      pipeline::uncertainty_at_um(maps_.contact_um(summary_.deepest_mm, 0, trust),
                                  pipeline::bend_um(sums, frame.depth().mm_per_px()),
                                  static_cast<int>(frame.depth().decimation())));
  auto& contact = *frame.mutable_contact();
  contact.set_touching(summary_.touching);
  contact.set_area_mm2(summary_.area_mm2);
  contact.set_x_mm(summary_.x_mm);
  contact.set_y_mm(summary_.y_mm);
  contact.set_deepest_mm(summary_.deepest_mm);
  contact.set_deepest_x_mm(summary_.deepest_x_mm);
  contact.set_deepest_y_mm(summary_.deepest_y_mm);
  contact.set_volume_mm3(summary_.volume_mm3);
  contact.clear_force_n();
  contact.clear_force_uncertainty_n();
  if (summary_.force) {
    contact.set_force_n(summary_.force->newtons);
    contact.set_force_uncertainty_n(summary_.force->uncertainty_n);
  }
  frame.clear_contact_absence();
  frame.clear_calibration();  // of the daemon's numbers it has none
  frame.clear_times();
  set(frame, v1::HEALTH_UNCALIBRATED, false);
  set(frame, v1::HEALTH_BEYOND_CALIBRATION, beyond);
}

}  // namespace dtact::reprocess
