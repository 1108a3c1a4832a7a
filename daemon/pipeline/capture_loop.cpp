#include "daemon/pipeline/capture_loop.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

namespace dtact::pipeline {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;
/// The longest wait for one frame, so that commands and stop are noticed however slow the camera.
constexpr std::chrono::milliseconds kLongestGrab{100};
/// Pause before a camera that is away is asked again.
constexpr std::int64_t kAwayPauseNs = 20'000'000;
/// The published method knows no gain: a light brighter or dimmer than at calibration by this share
/// makes every depth wrong by as much.
constexpr double kOtherLevel = 0.1;

}  // namespace

CaptureLoop::CaptureLoop(const CaptureParts& parts, const PipelineConfig& config,
                         std::unique_ptr<ActiveCalibration> active, bool unusable)
    : camera_(parts.camera),
      light_(parts.light),
      writer_(parts.writer),
      place_(parts.place),
      exchange_(parts.exchange),
      clock_(parts.clock),
      config_(config),
      period_ns_(std::llround(1e9 / camera_.info().fps)),
      active_(std::move(active)),
      unusable_(unusable),
      keeper_(camera_.info().width, camera_.info().height, config.reference),
      contact_(config.contact),
      chooser_(config.reconstruction.max_error_um),
      watch_(period_ns_),
      follower_(config.drift),
      timeline_(config.light, camera_.info().light_delay_frames, period_ns_),
      teller_(exchange_),
      whole_{0, 0, camera_.info().width, camera_.info().height},
      area_(whole_),
      shown_(config.light) {
  // What the status says until the first frame.
  exchange_.state = state();
  exchange_.health = health(true, clock_.monotonic_ns()).bits();
}

void CaptureLoop::restore(std::span<const std::uint16_t> reference_q8, const hal::Light& light) {
  keeper_.restore(reference_q8, light == config_.light, light.leds == config_.light.leds);
}

void CaptureLoop::run() noexcept {
  if (active_) {
    keeper_.use_calibration(active_->calibration->model->reference_q8, active_->grid,
                            active_->region);
    place_.use_calibration(active_->calibration, active_->region);
    light_mismatch_ = light_differs(*active_->calibration, shown_);
  }
  const auto timeout =
      std::min<std::chrono::nanoseconds>(std::chrono::nanoseconds(3 * period_ns_), kLongestGrab);
  watch_.started(clock_.monotonic_ns());
  while (!exchange_.stop.load(std::memory_order_relaxed)) {
    take_notes();
    take_orders();
    choose_area();
    const std::int64_t asked_ns = clock_.monotonic_ns();
    const hal::GrabStatus status = camera_.grab(frame_, timeout);
    const std::int64_t now_ns = clock_.monotonic_ns();
    take_notes();  // a change during the wait concerns this frame
    if (status == hal::GrabStatus::ok) {
      process(now_ns);
    } else {
      without_frame(status, asked_ns, now_ns);
    }
    teller_.flush();
  }
  frame_.reset();
}

// Decoding is most of the work on a frame: no more than somebody reads.
void CaptureLoop::choose_area() noexcept {
  hal::Area area = whole_;
  if (active_ && !keeper_.looks() && !exchange_.want_luma.load(std::memory_order_relaxed)) {
    const recon::FrameRegion region = active_->reconstructor().region();
    area = {region.x, region.y, region.width, region.height};
  }
  if (area == area_) return;
  area_ = area;
  camera_.will_read(area_);
}

void CaptureLoop::process(std::int64_t now_ns) noexcept {
  const hal::FrameInfo& info = frame_.info();
  if (watch_.arrived(info, now_ns)) {
    keeper_.begin();
    exchange_.camera_returned.store(true, std::memory_order_release);
    exchange_.wake.signal();
  }
  controls_moved_ = (info.flags & hal::kFrameControlsMoved) != 0;
  const std::int64_t exposure_ns = exposure_start_ns(info, period_ns_);
  const bool settled = timeline_.settled_at(exposure_ns);

  DepthFrame& out = exchange_.slot.back();
  out.camera = info;
  out.wall_ns = clock_.wall_ns() - (clock_.monotonic_ns() - info.timestamp_ns);
  out.light = timeline_.light_at(exposure_ns);
  out.times = {};
  out.times.decode_ns = info.decode_ns;
  out.has_depth = active_ && settled && keeper_.ready();
  beyond_ = false;
  if (out.has_depth) {
    reconstruct(out);
  } else {
    image_watch_.forget();
    // Nothing is known of contact meanwhile; what was known stands.
    out.contact = {};
    out.contact.touching = contact_.touching();
  }
  // The health of this frame, before its image changes the reference for the next.
  out.health = health(settled, now_ns);
  teller_.contact(out);
  const bool untouched = out.has_depth && keeper_.footing() == Footing::fresh &&
                         !contact_.touching() && !light_mismatch_;
  publish(out);
  mind_reference(settled);
  place_.look(frame_.luma(), untouched, now_ns);
  tell(health(timeline_.settled_at(exposure_ns), now_ns), now_ns);
  frame_.reset();
}

void CaptureLoop::reconstruct(DepthFrame& out) noexcept {
  recon::Reconstructor& reconstructor = active_->reconstructor();
  const recon::Model& model = reconstructor.model();
  out.width = model.rectify.width;
  out.height = model.rectify.height;
  out.mm_per_px = model.mm_per_px;
  // Within the capacity reserved at start, so this allocates nothing.
  out.depth_um.resize(static_cast<std::size_t>(out.width) * static_cast<std::size_t>(out.height));
  // What another calibration or resolution drew in this buffer says nothing about this one's map.
  const bool another = out.drawn_generation != active_->generation ||
                       out.drawn_decimation != model.rectify.decimation;
  if (another) out.drawn.rest = 0;
  out.drawn_generation = active_->generation;
  out.drawn_decimation = model.rectify.decimation;
  recon::StepTimes steps;
  recon::ActivityReport activity;
  const hal::LumaView& luma = frame_.luma();
  reconstructor.run_active(luma.data, luma.stride, out.depth_um, out.drawn, activity, &steps);
  image_watch_.look(activity, luma, follower_.factor());
  if (keeper_.footing() == Footing::fresh) {
    follow_due_ = follower_.look(activity, out.camera.timestamp_ns);
  }
  out.times.activity_ns = steps.activity_ns;
  out.times.rectify_ns = steps.rectify_ns;
  out.times.smooth_ns = steps.smooth_ns;
  out.times.list_ns = steps.list_ns;
  const std::int64_t began_ns = clock_.monotonic_ns();
  out.contact =
      contact_.inspect(out.depth_um, reconstructor.grid(), out.drawn.tiles, out.mm_per_px);
  const int pixel = model.rectify.decimation * model.rectify.decimation;
  beyond_ = reconstructor.beyond_pixels() * pixel > config_.beyond_pixels;
  judge(out);
  out.times.inspect_ns = clock_.monotonic_ns() - began_ns;
}

void CaptureLoop::use_reference() noexcept {
  active_->set_reference(keeper_.reference());
  const recon::Model& model = *active_->calibration->model;
  follower_.restart(model.method == recon::Method::list);
  follow_due_.reset();
  place_.hurry();
  exchange_.light_followed.store(0, std::memory_order_relaxed);
  const recon::RectifyTable& table = model.rectify;
  image_watch_.set_reference(keeper_.reference(), table.frame_width, table.frame_height,
                             active_->region);
  const double light = image_watch_.reference_mean() / active_->grid.mean;
  other_level_ = model.method == recon::Method::published && std::abs(light - 1) > kOtherLevel;
}

/// What the map is worth, and at which resolution the next is made.
void CaptureLoop::judge(DepthFrame& out) noexcept {
  const auto from_um = static_cast<std::int16_t>(1000 * config_.contact.made_mm);
  const double bend = bend_um(out.depth_um, active_->reconstructor().grid(), out.drawn.tiles,
                              out.mm_per_px, from_um);
  // Half of the deepest is about the mean over a contact.
  double list_um = active_->list_um(0.5 * out.contact.deepest_mm);
  if (keeper_.footing() == Footing::stale) list_um = std::hypot(list_um, kStaleReferenceUm);
  list_um = std::hypot(list_um, active_->light_um(follower_.left()));
  out.decimation = out.drawn_decimation;
  out.uncertainty_um = uncertainty_at_um(list_um, bend, out.decimation);
  if (config_.reconstruction.decimation == 0) {
    active_->use_decimation(chooser_.next(list_um, bend));
  }
}

void CaptureLoop::publish(DepthFrame& out) noexcept {
  const std::int64_t began_ns = clock_.monotonic_ns();
  const bool reconstructed = out.has_depth;
  const bool want_depth = exchange_.want_depth.load(std::memory_order_relaxed);
  const bool want_luma = exchange_.want_luma.load(std::memory_order_relaxed);
  out.has_depth = reconstructed && want_depth;
  out.has_luma = want_luma && area_ == whole_;  // not the frame before the one asked for
  if (out.has_luma) {
    const hal::LumaView& luma = frame_.luma();
    const auto width = static_cast<std::size_t>(luma.width);
    out.luma_width = luma.width;
    out.luma_height = luma.height;
    out.luma.resize(width * static_cast<std::size_t>(luma.height));  // reserved at start
    for (int y = 0; y < luma.height; ++y) {
      std::copy_n(luma.row(y), width, out.luma.data() + std::ptrdiff_t{y} * luma.width);
    }
  }
  out.skipped = exchange_.slot.replaced();
  out.done_ns = clock_.monotonic_ns();
  out.times.publish_ns = out.done_ns - began_ns;
  exchange_.statistics.add(out.times, reconstructed, out.camera.ready_ns, out.done_ns);
  if (!want_depth && !out.has_luma) return;
  exchange_.slot.publish();
  exchange_.frames.fetch_add(1, std::memory_order_relaxed);
  exchange_.wake.signal();
}

void CaptureLoop::mind_reference(bool settled) noexcept {
  if (active_ && follow_due_) {
    active_->set_light(*follow_due_);
    exchange_.light_followed.store(*follow_due_ - 1, std::memory_order_relaxed);
    follow_due_.reset();
  }
  if (!active_ || !settled || (keeper_.looks() && area_ != whole_)) return;
  const KeeperStep step = keeper_.step(frame_.luma());
  if (step.reference_changed) {
    use_reference();
    if (keeper_.footing() != Footing::stale) {
      teller_.reference({frame_.info().sequence, keeper_.footing() == Footing::restored});
    }
    keep_due_ = keeper_.worth_keeping();
  }
  if (step.answer) answer(*step.answer);
  if (keep_due_ && keeper_.ready()) {
    keep_due_ = !writer_.offer(keeper_.reference(), shown_, active_->calibration);
  }
}

void CaptureLoop::without_frame(hal::GrabStatus status, std::int64_t asked_ns,
                                std::int64_t now_ns) noexcept {
  watch_.missed(status, now_ns);
  if (watch_.away() || watch_.silent_ns(now_ns) > kSecond) {
    give_up_rezero();
  }
  tell(health(true, now_ns), now_ns);
  // A camera that answers at once is not asked again at once, unless it had a frame.
  if (status != hal::GrabStatus::damaged && now_ns - asked_ns < kAwayPauseNs) {
    clock_.sleep_until(asked_ns + kAwayPauseNs);
  }
}

void CaptureLoop::tell(HealthSet health, std::int64_t now_ns) noexcept {
  // A press at the list's end would send an event with every frame: the condition is told to last
  // a second longer than it does.
  if (beyond_) beyond_until_ns_ = now_ns + kSecond;
  health.set(Health::beyond_calibration, now_ns < beyond_until_ns_);
  teller_.state(state(), health);
  exchange_.state.store(state(), std::memory_order_relaxed);
  exchange_.health.store(health.bits(), std::memory_order_relaxed);
}

State CaptureLoop::state() const noexcept {
  if (watch_.away()) return State::camera_lost;
  return active_ ? keeper_.state() : State::uncalibrated;
}

HealthSet CaptureLoop::health(bool settled, std::int64_t now_ns) const noexcept {
  HealthSet set;
  if (active_) {
    set.set(Health::starting, keeper_.starting());
    set.set(Health::light_unsettled, !settled || (!keeper_.ready() && !keeper_.starting()));
    set.set(Health::reference_stale, keeper_.footing() == Footing::stale);
    set.set(Health::reference_restored, keeper_.footing() == Footing::restored);
  } else {
    set.set(Health::uncalibrated);
    set.set(Health::light_unsettled, !settled);
  }
  set.set(Health::light_mismatch, light_mismatch_ || other_level_);
  const bool differs = active_ && exchange_.camera_mismatch.load(std::memory_order_relaxed);
  set.set(Health::camera_mismatch, unusable_ || controls_moved_ || differs);
  set.set(Health::camera_moved, place_.moved());
  set.set(Health::beyond_calibration, beyond_);
  set.set(Health::frames_lost, watch_.lost_lately(now_ns));
  set.set(Health::camera_trouble, watch_.trouble());
  set.set(Health::ring_trouble, light_.trouble());
  set.add(image_watch_.conditions());
  if (follower_.drifted()) set.set(Health::light_drifted);
  set.set(Health::not_realtime, exchange_.not_realtime.load(std::memory_order_relaxed));
  return set;
}

}  // namespace dtact::pipeline
