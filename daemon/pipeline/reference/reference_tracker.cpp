#include "daemon/pipeline/reference/reference_tracker.hpp"

#include <cmath>

#include "daemon/pipeline/reference/reference_store.hpp"

namespace dtact::pipeline {
namespace {

/// The published method knows no gain: a light brighter or dimmer than at calibration by this share
/// makes every depth wrong by as much.
constexpr double kOtherLevel = 0.1;
/// References of one light are written at most this often, and the first of another light this long
/// after the last one: clients may re-zero and change the light at any rate, and disks wear.
constexpr std::int64_t kKeepEveryNs = 300'000'000'000;
constexpr std::int64_t kKeepChangedNs = 30'000'000'000;

}  // namespace

ReferenceTracker::ReferenceTracker(int width, int height, const LightTimeline& light,
                                   const PipelineConfig& config, int decode_scale)
    : width_(width),
      height_(height),
      timeline_(light),
      folder_(config.state_folder),
      writer_(width, height, folder_, side_),
      camera_shift_(width, height, config.reference.frames, side_, decode_scale),
      keeper_(width, height, config.reference),
      follower_(config.drift) {}

void ReferenceTracker::restore(const calibration::Calibration& calibration) {
  if (folder_.empty()) return;
  const auto stored = load_reference(calibration, width_, height_, folder_);
  if (stored) restore(stored->image_q8, stored->light);
}

void ReferenceTracker::restore(std::span<const std::uint16_t> reference_q8,
                               const hal::Light& light) {
  keeper_.restore(reference_q8, light == ring_light(), light.leds == ring_light().leds);
}

void ReferenceTracker::use(CalibratedImage* image) noexcept {
  image_ = image;
  keep_every_ns_ = kKeepChangedNs;
  if (image == nullptr) return;
  other_light_ = light_differs(*image->calibration, ring_light());
  keeper_.use_calibration(image->calibration->model->reference_q8, image->grid, image->region,
                          !other_light_);
  camera_shift_.use_marks(image->marks);
  if (!keeper_.ready()) return;
  // The reference stays as it was taken, and so does the light that was followed since.
  const LightFollower before = follower_;
  use_reference();
  if (before.follows() && follower_.follows()) {
    follower_ = before;
    image_->cells.set_light(follower_.factor());
  }
}

void ReferenceTracker::camera_began() noexcept { keeper_.begin(); }

void ReferenceTracker::light_changed(const hal::Light& before) noexcept {
  // Rewriting the light that is already shown leaves the reference valid.
  if (before == ring_light()) return;
  keep_every_ns_ = kKeepChangedNs;
  keeper_.light_changed(in_contact_, before.leds == ring_light().leds);
  other_light_ = image_ != nullptr && light_differs(*image_->calibration, ring_light());
}

void ReferenceTracker::exposure_changed() noexcept {
  keep_every_ns_ = kKeepChangedNs;
  keeper_.light_changed(in_contact_, true);
}

Observation ReferenceTracker::look(const hal::LumaView& luma, const FrameState& moment) noexcept {
  Observation look;
  settled_ = moment.settled;
  if (image_ == nullptr) return look;
  if (moment.settled && (moment.whole || !keeper_.looks())) {
    const ReferenceStep step = keeper_.step(luma);
    look.new_reference = step.reference_changed;
    look.rezeroed = step.answer;
  }
  if (look.new_reference) use_reference();
  look.measurable = moment.settled && keeper_.ready();
  const bool fresh = look.measurable && keeper_.quality() == ReferenceQuality::fresh;
  camera_shift_.look(luma, fresh && !in_contact_ && !other_light_, moment.now_ns);
  if (!look.measurable) {
    report_ = {};
    watch_.forget();
    exposure_.forget();
    return look;
  }
  report_ = image_->cells.look(luma);
  const auto compared = watch_.look(report_, luma, follower_.factor());
  if (fresh) {
    exposure_.look(report_.light, compared, moment.timestamp_ns);
    if (const auto factor = follower_.look(report_.light, moment.timestamp_ns)) {
      image_->cells.set_light(*factor);
      look.new_light = true;
    }
  }
  keep_reference(moment.now_ns);
  return look;
}

/// Measures depth against the keeper's reference from now on.
void ReferenceTracker::use_reference() noexcept {
  const recon::Model& model = *image_->calibration->model;
  const auto reference = keeper_.reference();
  image_->cells.set_reference(reference);
  // The published method cannot apply a factor to its depth.
  follower_.restart(model.method == recon::Method::lut);
  watch_.set_reference(reference, width_, height_, image_->region);
  exposure_.restart();
  camera_shift_.check_now();
  const double level = watch_.reference_mean() / image_->grid.mean;
  other_level_ = model.method == recon::Method::published && std::abs(level - 1) > kOtherLevel;
  keep_due_ = keeper_.storable();
}

/// The writer may still be busy: then the next frame offers the reference again.
void ReferenceTracker::keep_reference(std::int64_t now_ns) noexcept {
  if (!keep_due_ || (kept_ns_ && now_ns - *kept_ns_ < keep_every_ns_)) return;
  keep_due_ = !writer_.offer(keeper_.reference(), ring_light(), image_->calibration);
  if (keep_due_) return;
  kept_ns_ = now_ns;
  keep_every_ns_ = kKeepEveryNs;
}

void ReferenceTracker::stop() noexcept {
  if (keep_due_ && image_ != nullptr && keeper_.ready() && keeper_.storable()) {
    writer_.settle();
    keep_due_ = !writer_.offer(keeper_.reference(), ring_light(), image_->calibration);
  }
  side_.stop();
}

State ReferenceTracker::state() const noexcept {
  return image_ == nullptr ? State::uncalibrated : keeper_.state();
}

HealthSet ReferenceTracker::health_flags() const noexcept {
  HealthSet set;
  if (image_ == nullptr) {
    set.set(Health::uncalibrated);
    set.set(Health::light_unsettled, !settled_);
    return set;
  }
  set.set(Health::starting, keeper_.starting());
  set.set(Health::light_unsettled, !settled_ || (!keeper_.ready() && !keeper_.starting()));
  set.set(Health::reference_stale, keeper_.quality() == ReferenceQuality::stale);
  set.set(Health::reference_restored, keeper_.quality() == ReferenceQuality::restored);
  set.set(Health::light_mismatch, other_light_ || other_level_);
  set.set(Health::camera_shifted, camera_shift_.moved());
  set.set(Health::exposure_unlocked, exposure_.follows());
  set.add(watch_.health_flags());
  if (settled_ && keeper_.dark()) set.set(Health::image_dark);
  if (follower_.drifted()) set.set(Health::light_drifted);
  return set;
}

Trust ReferenceTracker::trust() const noexcept {
  return {.stale = keeper_.quality() == ReferenceQuality::stale,
          .light_left = follower_.left(),
          .light_unseen = follower_.unseen()};
}

}  // namespace dtact::pipeline
