#include "daemon/pipeline/capture_loop.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "hal/base/realtime_throttle.hpp"
#include "hal/base/rt_thread.hpp"

namespace dtact::pipeline {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;
/// The longest wait for one frame, so that commands and stop are noticed however slow the camera.
constexpr std::chrono::milliseconds kLongestGrab{100};
/// Pause before the next grab() from a camera that is away.
constexpr std::int64_t kAwayPauseNs = 20'000'000;
/// For the rest of the machine, ten times a second, when the camera is faster than this thread.
constexpr std::chrono::milliseconds kPause{10};
/// What the newest picture shows. Of a camera that is away it says nothing.
constexpr std::array kOfPicture{Health::image_saturated,   Health::image_dark,
                                Health::image_noisy,       Health::image_repeated,
                                Health::light_banded,      Health::light_drifted,
                                Health::beyond_calibration};

}  // namespace

CaptureLoop::CaptureLoop(const CaptureParts& parts, const PipelineConfig& config,
                         std::shared_ptr<ActiveCalibration> active, bool unusable)
    : camera_(parts.camera),
      light_(parts.light),
      exchange_(parts.exchange),
      clock_(parts.clock),
      period_ns_(std::llround(1e9 / camera_.info().fps)),
      decode_scale_(camera_.info().decode_scale),
      reference_(config.reference),
      timeout_(std::min<std::chrono::nanoseconds>(
          std::chrono::nanoseconds(hal::stall_ns(period_ns_)), kLongestGrab)),
      timeline_(config.light, config.light_delay_frames.value_or(camera_.info().light_delay_frames),
                period_ns_),
      tracker_(camera_.info().width, camera_.info().height, timeline_, config, decode_scale_),
      depth_(config, clock_),
      watch_(period_ns_),
      reporter_(exchange_),
      executor_(exchange_, reporter_, tracker_, depth_),
      whole_{0, 0, camera_.info().width, camera_.info().height},
      area_(whole_),
      unusable_(unusable) {
  const std::int64_t now_ns = clock_.monotonic_ns();
  watch_.started(now_ns);
  executor_.begin(std::move(active));
  // The status until the first frame.
  exchange_.state = state();
  exchange_.health = health(now_ns).bits();
}

void CaptureLoop::run() noexcept {
  watch_.started(clock_.monotonic_ns());
  base::RealtimeThrottle throttle(clock_, kPause);
  while (!exchange_.stop.load(std::memory_order_relaxed)) {
    step();
    throttle.pause_if_busy();
    if (base::was_demoted()) exchange_.not_realtime.store(true, std::memory_order_relaxed);
  }
  frame_.reset();
}

void CaptureLoop::step() noexcept {
  exchange_.turns.fetch_add(1, std::memory_order_relaxed);
  take_notes();
  executor_.take(watch_.away(), stamp(clock_.monotonic_ns()));
  choose_area();
  const std::int64_t asked_ns = clock_.monotonic_ns();
  const hal::GrabStatus status = camera_.grab(frame_, timeout_);
  const std::int64_t now_ns = clock_.monotonic_ns();
  take_notes();  // a change during the wait concerns this frame
  if (status == hal::GrabStatus::ok) {
    process(now_ns);
  } else {
    without_frame(status, asked_ns, now_ns);
  }
}

void CaptureLoop::take_notes() noexcept {
  LightNote note;
  while (light_.next_note(note)) {
    const hal::Light before = timeline_.light();
    if (note.begins) {
      timeline_.change_begins(note.light, note.at_ns);
    } else {
      timeline_.change_ends(note.light, note.at_ns, note.failed);
    }
    tracker_.light_changed(before);
    if (note.camera) tracker_.exposure_changed();
    // What was seen under no light or an unknown one counts no more than before a start.
    if (note.returned) tracker_.camera_began();
  }
}

// Decoding is most of the work on a frame, so decodes only the area that is used.
void CaptureLoop::choose_area() noexcept {
  hal::Area area = whole_;
  if (executor_.active() != nullptr && !tracker_.needs_whole_frame() &&
      !exchange_.wanted.load(std::memory_order_relaxed).luma) {
    const recon::FrameRegion region = executor_.active()->image.cells.lattice().region();
    area = {region.x, region.y, region.width, region.height};
  }
  if (area == area_) return;
  area_ = area;
  camera_.will_read(area_);
}

void CaptureLoop::process(std::int64_t now_ns) noexcept {
  const hal::FrameInfo& info = frame_.info();
  if (watch_.arrived(info, now_ns)) {
    tracker_.camera_began();
    exchange_.camera_returned.store(true, std::memory_order_release);
    exchange_.wake.signal();
  }
  exchange_.camera_damaged.store(false, std::memory_order_relaxed);
  exchange_.camera_fps.store(watch_.rate().fps(), std::memory_order_relaxed);
  exchange_.sequence.store(info.sequence, std::memory_order_relaxed);
  exchange_.light_lag_ns.store(timeline_.delay_ns() + stamp_lag_ns(info.meaning, period_ns_),
                               std::memory_order_relaxed);
  // Read once for each frame, so that none has only a part of a new request.
  wanted_ = exchange_.wanted.load(std::memory_order_relaxed);
  const bool moved = (info.flags & hal::kFrameControlsMoved) != 0;
  // They have just been set back. A reference of the last second may be of what they had moved to.
  if (moved && !controls_moved_) tracker_.camera_began();
  controls_moved_ = moved;
  const std::int64_t exposure_ns = exposure_start_ns(info, period_ns_);

  DepthFrame& out = exchange_.slot.back();
  label(out, exposure_ns);
  look(out, {.timestamp_ns = info.timestamp_ns,
             .now_ns = now_ns,
             .settled = timeline_.settled_at(exposure_ns),
             .whole = area_ == whole_});
  executor_.limit_rezero(rezero_limit_ns(), now_ns);
  const HealthSet health_flags = health(now_ns);
  out.health = health_flags;
  reporter_.contact(out);
  reporter_.flush();
  publish(out);  // from here on the network owns `out`
  emit(health_flags, now_ns);
  frame_.reset();
}

/// So that the answer comes within the promised time: a frame earlier.
std::int64_t CaptureLoop::rezero_limit_ns() const noexcept {
  const double mode_fps = 1e9 / static_cast<double>(period_ns_);
  return std::llround(1e9 * reference_.rezero_timeout_s(mode_fps, watch_.rate().fps())) -
         period_ns_;
}

void CaptureLoop::label(DepthFrame& out, std::int64_t exposure_ns) noexcept {
  out.camera = frame_.info();
  out.wall_ns = clock_.wall_ns() - (clock_.monotonic_ns() - out.camera.timestamp_ns);
  out.light = timeline_.light_at(exposure_ns);
  out.light_since_ns = timeline_.since_at(exposure_ns);
  if (out.light_since_ns) *out.light_since_ns += stamp_lag_ns(out.camera.meaning, period_ns_);
  out.calibration.reset();
  if (executor_.active() != nullptr) out.calibration = executor_.key();
  out.times = {};
  out.times.decode_ns = out.camera.decode_ns;
}

/// Updates the reference image from the frame, then measures depth against it.
void CaptureLoop::look(DepthFrame& out, const FrameState& moment) noexcept {
  const std::int64_t began_ns = clock_.monotonic_ns();
  const Observation look = tracker_.look(frame_.luma(), moment);
  out.times.activity_ns = clock_.monotonic_ns() - began_ns;
  if (look.new_reference) {
    depth_.set_reference(tracker_.reference());
    executor_.reference_taken(out.camera.sequence);
    if (tracker_.quality() != ReferenceQuality::stale) {
      reporter_.reference({tracker_.quality() == ReferenceQuality::restored,
                           {out.camera.sequence, out.camera.timestamp_ns, out.wall_ns}});
    }
  }
  if (look.new_light) depth_.set_light(tracker_.light());
  if (look.rezeroed) executor_.answer(*look.rezeroed);
  const bool measured = look.measurable && wanted_.contact;
  if (measured) {
    depth_.make(frame_.luma(), tracker_, wanted_.depth, out);
  } else if (executor_.active() == nullptr) {
    depth_.skip(out, ContactAbsence::uncalibrated);
  } else {
    depth_.skip(out, look.measurable ? ContactAbsence::unasked : ContactAbsence::referencing);
  }
  if (look.measurable) {
    tracker_.set_in_contact(measured ? depth_.in_contact() : tracker_.any_active());
  }
  exchange_.light_followed.store(tracker_.light() - 1, std::memory_order_relaxed);
}

void CaptureLoop::publish(DepthFrame& out) noexcept {
  const std::int64_t began_ns = clock_.monotonic_ns();
  const bool made = out.has_depth;
  out.has_depth = made && wanted_.depth;
  out.has_luma = wanted_.luma && area_ == whole_;  // outside the area anything may be
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
  // The buffer holds a picture of this size without compression.
  out.has_jpeg =
      wanted_.jpeg && !frame_.jpeg().empty() && frame_.jpeg().size() <= out.jpeg.capacity();
  if (out.has_jpeg) {
    out.jpeg_width = frame_.luma().width * decode_scale_;
    out.jpeg_height = frame_.luma().height * decode_scale_;
    out.jpeg.assign(frame_.jpeg().begin(), frame_.jpeg().end());
  }
  out.done_ns = clock_.monotonic_ns();
  out.times.publish_ns = out.done_ns - began_ns;
  exchange_.statistics.add(out.times, made, out.camera.ready_ns, out.done_ns);
  if (!wanted_.depth && !out.has_luma && !wanted_.jpeg) return;
  out.number = exchange_.frames.fetch_add(1, std::memory_order_relaxed) + 1;
  exchange_.slot.publish();
  exchange_.wake.signal();
}

void CaptureLoop::without_frame(hal::GrabStatus status, std::int64_t asked_ns,
                                std::int64_t now_ns) noexcept {
  watch_.missed(status, now_ns);
  if (watch_.away()) controls_moved_ = false;
  exchange_.camera_damaged.store(watch_.damaged(), std::memory_order_relaxed);
  exchange_.camera_fps.store(watch_.rate().fps(), std::memory_order_relaxed);
  // A slow camera is silent for longer between two frames.
  const std::int64_t silence_ns = std::max(kSecond, hal::stall_ns(period_ns_));
  if (watch_.away() || watch_.silent_ns(now_ns) > silence_ns) executor_.abort_rezero();
  emit(health(now_ns), now_ns);
  reporter_.flush();
  // A camera that fails at once is not retried at once, unless it had a frame.
  if (status != hal::GrabStatus::damaged && now_ns - asked_ns < kAwayPauseNs) {
    clock_.sleep_until(asked_ns + kAwayPauseNs);
  }
}

void CaptureLoop::emit(HealthSet health, std::int64_t now_ns) noexcept {
  reporter_.state(state(), health, stamp(now_ns));
}

/// After the newest frame.
Stamp CaptureLoop::stamp(std::int64_t at_ns) const noexcept {
  return {exchange_.sequence.load(std::memory_order_relaxed), at_ns,
          clock_.wall_ns() - (clock_.monotonic_ns() - at_ns)};
}

State CaptureLoop::state() const noexcept {
  return watch_.away() ? State::camera_lost : tracker_.state();
}

HealthSet CaptureLoop::health(std::int64_t now_ns) const noexcept {
  HealthSet set = tracker_.health_flags();
  const bool differs =
      executor_.active() != nullptr && exchange_.camera_mismatch.load(std::memory_order_relaxed);
  const bool unusable = unusable_ && executor_.active() == nullptr;
  set.set(Health::camera_mismatch, unusable || controls_moved_ || differs);
  set.set(Health::beyond_calibration, depth_.beyond());
  if (watch_.away()) {
    for (const Health of_picture : kOfPicture) set.set(of_picture, false);
  }
  set.set(Health::frames_lost, watch_.lost_lately(now_ns));
  set.set(Health::camera_fault, watch_.trouble());
  set.set(Health::camera_slow, watch_.rate().slow());
  set.set(Health::machine_slow, watch_.skips().behind());
  set.set(Health::ring_fault, light_.trouble());
  set.set(Health::not_realtime, exchange_.not_realtime.load(std::memory_order_relaxed));
  return set;
}

}  // namespace dtact::pipeline
