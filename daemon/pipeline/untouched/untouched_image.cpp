#include "daemon/pipeline/untouched/untouched_image.hpp"

#include <cmath>

#include "daemon/pipeline/untouched/reference_store.hpp"

namespace dtact::pipeline {
namespace {

/// The published method knows no gain: a light brighter or dimmer than at calibration by this share
/// makes every depth wrong by as much.
constexpr double kOtherLevel = 0.1;

}  // namespace

UntouchedImage::UntouchedImage(int width, int height, const hal::Light& light,
                               const PipelineConfig& config)
    : width_(width),
      height_(height),
      folder_(config.state_folder),
      writer_(width, height, folder_, side_),
      place_(width, height, config.reference.frames, side_),
      keeper_(width, height, config.reference),
      follower_(config.drift),
      shown_(light) {}

void UntouchedImage::restore(const calibration::Calibration& calibration) {
  if (folder_.empty()) return;
  const auto stored = load_reference(calibration, width_, height_, folder_);
  if (stored) restore(stored->image_q8, stored->light);
}

void UntouchedImage::restore(std::span<const std::uint16_t> reference_q8, const hal::Light& light) {
  keeper_.restore(reference_q8, light == shown_, light.leds == shown_.leds);
}

void UntouchedImage::use(CalibratedImage* image) noexcept {
  image_ = image;
  if (image == nullptr) return;
  other_light_ = light_differs(*image->calibration, shown_);
  keeper_.use_calibration(image->calibration->model->reference_q8, image->grid, image->region,
                          !other_light_);
  place_.use_marks(image->marks);
  if (!keeper_.ready()) return;
  // The reference stays as it was taken, and so does the light that was followed since.
  const LightFollower before = follower_;
  use_reference();
  if (before.follows() && follower_.follows()) {
    follower_ = before;
    image_->cells.set_light(follower_.factor());
  }
}

void UntouchedImage::camera_began() noexcept { keeper_.begin(); }

void UntouchedImage::light_changes(const hal::Light& light) noexcept {
  // Rewriting what is shown anyway leaves the reference as good as it was.
  if (light == shown_) return;
  keeper_.light_changed(touched_, light.leds == shown_.leds);
  shown_ = light;
  other_light_ = image_ != nullptr && light_differs(*image_->calibration, shown_);
}

Look UntouchedImage::look(const hal::LumaView& luma, const Moment& moment) noexcept {
  Look look;
  settled_ = moment.settled;
  if (image_ == nullptr) return look;
  if (moment.settled && (moment.whole || !keeper_.looks())) {
    const KeeperStep step = keeper_.step(luma);
    look.new_reference = step.reference_changed;
    look.rezeroed = step.answer;
  }
  if (look.new_reference) use_reference();
  look.measurable = moment.settled && keeper_.ready();
  const bool fresh = look.measurable && keeper_.footing() == Footing::fresh;
  place_.look(luma, fresh && !touched_ && !other_light_, moment.now_ns);
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
  keep_reference();
  return look;
}

/// From now on depth is measured against the keeper's reference.
void UntouchedImage::use_reference() noexcept {
  const recon::Model& model = *image_->calibration->model;
  const auto reference = keeper_.reference();
  image_->cells.set_reference(reference);
  // Nobody can apply a factor where depth is measured by the published method.
  follower_.restart(model.method == recon::Method::list);
  watch_.set_reference(reference, width_, height_, image_->region);
  exposure_.restart();
  place_.hurry();
  const double level = watch_.reference_mean() / image_->grid.mean;
  other_level_ = model.method == recon::Method::published && std::abs(level - 1) > kOtherLevel;
  keep_due_ = keeper_.worth_keeping();
}

/// The writer may be busy with the one before: then it is offered again with the next frame.
void UntouchedImage::keep_reference() noexcept {
  if (!keep_due_) return;
  keep_due_ = !writer_.offer(keeper_.reference(), shown_, image_->calibration);
}

State UntouchedImage::state() const noexcept {
  return image_ == nullptr ? State::uncalibrated : keeper_.state();
}

HealthSet UntouchedImage::conditions() const noexcept {
  HealthSet set;
  if (image_ == nullptr) {
    set.set(Health::uncalibrated);
    set.set(Health::light_unsettled, !settled_);
    return set;
  }
  set.set(Health::starting, keeper_.starting());
  set.set(Health::light_unsettled, !settled_ || (!keeper_.ready() && !keeper_.starting()));
  set.set(Health::reference_stale, keeper_.footing() == Footing::stale);
  set.set(Health::reference_restored, keeper_.footing() == Footing::restored);
  set.set(Health::light_mismatch, other_light_ || other_level_);
  set.set(Health::camera_moved, place_.moved());
  set.set(Health::exposure_follows, exposure_.follows());
  set.add(watch_.conditions());
  if (settled_ && keeper_.dark()) set.set(Health::image_dark);
  if (follower_.drifted()) set.set(Health::light_drifted);
  return set;
}

Trust UntouchedImage::trust() const noexcept {
  return {.stale = keeper_.footing() == Footing::stale,
          .light_left = follower_.left(),
          .light_unseen = follower_.unseen()};
}

}  // namespace dtact::pipeline
