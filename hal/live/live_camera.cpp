#include "hal/live/live_camera.hpp"

#include <fmt/format.h>
#include <pthread.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "hal/base/clock.hpp"
#include "hal/base/rt_thread.hpp"
#include "hal/live/source.hpp"

namespace dtact::hal::live {
namespace {

constexpr std::int64_t kMillisecond = 1'000'000;
/// Between two attempts to open a camera that is away.
constexpr std::int64_t kRetry = 100 * kMillisecond;
/// From the start of the stream to its first frame cameras take up to this long; it isn't a stall.
constexpr std::int64_t kFirstFrame = 1000 * kMillisecond;
/// A camera that sends nothing usable is closed and opened anew after this long: many come back by
/// it.
constexpr std::int64_t kReopenAfter = 3000 * kMillisecond;
constexpr std::chrono::seconds kWatchPeriod{1};
/// Buffers looked at in one call: they go back as others come out, so there could be no end.
constexpr unsigned kMaxTaken = 8;
/// In frames; a larger step of the driver's count is a new count.
constexpr std::uint32_t kPlausibleGap = 1U << 16U;

std::int64_t now_ns() noexcept { return base::system_clock().monotonic_ns(); }

std::uint64_t get(const std::atomic<std::uint64_t>& counter) noexcept {
  return counter.load(std::memory_order_relaxed);
}

bool fits(const std::optional<double>& value, const std::optional<CameraSetting>& setting) {
  return value && setting && *value >= setting->minimum && *value <= setting->maximum;
}

/// What was changed of the camera before. Another one may lack it: then its own values stay, which
/// its controls say.
void change_again(CameraChange change, Opened& opened) {
  if (!fits(change.exposure_us, opened.settings.exposure_us)) change.exposure_us.reset();
  if (!fits(change.gain, opened.settings.gain)) change.gain.reset();
  if (!change.exposure_us && !change.gain) return;
  try {
    opened.source->change_before_use(change, opened.controls, opened.settings);
  } catch (const std::runtime_error&) {  // NOLINT(bugprone-empty-catch)
    // As above.
  }
}

}  // namespace

LiveCamera::LiveCamera(const CameraConfig& config, const std::string& backend,
                       const std::string& identity, Opener opener)
    : open_(std::move(opener)),
      period_ns_(std::llround(1e9 / config.fps)),
      decode_scale_(config.decode_scale),
      cpus_(base::allowed_cpus()),
      leases_(config.width / config.decode_scale, config.height / config.decode_scale) {
  if (!(config.fps > 0)) throw std::runtime_error("camera.fps must be positive");
  info_.backend = backend;
  info_.identity = identity;
  info_.width = config.width / decode_scale_;
  info_.height = config.height / decode_scale_;
  info_.decode_scale = decode_scale_;
  info_.fps = config.fps;
  fix_ = "the camera has not been started";
  watcher_ = std::thread([this] { watch_controls(); });
  ::pthread_setname_np(watcher_.native_handle(), "camera-watch");
}

LiveCamera::~LiveCamera() {
  {
    const std::lock_guard guard(mutex_);
    stopping_ = true;
  }
  wake_watcher_.notify_one();
  watcher_.join();
}

CameraInfo LiveCamera::info() const {
  const std::lock_guard guard(mutex_);
  return info_;
}

CameraReport LiveCamera::report() const {
  CameraReport report;
  report.delivered = get(counters_.delivered);
  report.lost = get(counters_.lost);
  report.skipped = get(counters_.skipped);
  report.disconnects = get(counters_.disconnects);
  report.damage = {get(counters_.flagged), get(counters_.markers), get(counters_.too_short),
                   get(counters_.undecodable)};
  report.damaged = report.damage.flagged + report.damage.markers + report.damage.too_short +
                   report.damage.undecodable;
  if (const char* const reason = damage_reason_.load()) report.damage_reason = reason;
  const std::lock_guard guard(mutex_);
  report.state = state_.load();
  report.fix = fix_;
  report.moved = moved_;
  return report;
}

void LiveCamera::start() {
  try {
    connect();
  } catch (const ModeError&) {
    throw;
  } catch (const DeviceError& e) {
    disconnect(e.state(), e.what());
  }
}

void LiveCamera::connect() {
  // The capture thread is real-time and pinned; threads that the driver's library starts must not
  // be.
  Opened opened;
  CameraChange changed;
  {
    const std::lock_guard guard(mutex_);
    changed = changed_;
  }
  base::run_unpinned(cpus_, [&] {
    opened = open_();
    change_again(changed, opened);
  });
  const std::string wrong = mjpeg::scale_error(decode_scale_, opened.pixel_format);
  if (!wrong.empty()) throw ModeError(wrong);
  auto fresh = std::make_shared<Connection>(opened.source, decode_scale_);
  if (area_) fresh->decoder.will_read(*area_);
  opened_ns_ = delivered_ns_ = now_ns();
  last_buffer_ns_ = 0;
  last_counted_.reset();
  buffers_free_ = opened.source->queued();
  taken_in_a_row_ = 0;
  driver_was_full_ = false;
  after_gap_ = get(counters_.delivered) > 0;
  reopened_ = after_gap_;
  std::unique_lock guard(mutex_);
  while (changed_ != changed) {  // meanwhile
    changed = changed_;
    guard.unlock();
    base::run_unpinned(cpus_, [&] { change_again(changed, opened); });
    guard.lock();
  }
  info_.identity = std::move(opened.identity);
  info_.pixel_format = std::move(opened.pixel_format);
  info_.controls = std::move(opened.controls);
  info_.settings = opened.settings;
  // A restart alone does not change what a stalled camera needs.
  if (state_.load() != CameraState::stalled) {
    fix_ = "the camera has been opened; its first frame is awaited";
  }
  leases_.use(opened.source);
  connection_ = std::move(fresh);
}

bool LiveCamera::try_connect() noexcept {
  try {
    connect();
    return true;
  } catch (const DeviceError& e) {
    try {
      disconnect(e.state(), e.what());
    } catch (const std::exception&) {
      // No memory for the sentence: the state alone has to do.
      state_.store(e.state());
    }
  } catch (const std::exception&) {
    state_.store(CameraState::unplugged);  // no memory; tried again
  }
  return false;
}

void LiveCamera::disconnect(CameraState state, const std::string& fix) {
  std::shared_ptr<Connection> old;
  {
    const std::lock_guard guard(mutex_);
    old = std::exchange(connection_, nullptr);
    leases_.use(nullptr);
    state_.store(state);
    fix_ = fix;
  }
  // The watcher may keep the object for a moment; the device must be free at once.
  if (old) {
    add(counters_.disconnects);
    old->source->stop();
  }
}

void LiveCamera::lose(const char* what) noexcept {
  try {
    disconnect(CameraState::unplugged,
               fmt::format("{} {}: plug it in again: it is found by itself", info_.identity, what));
  } catch (const std::exception&) {
    state_.store(CameraState::unplugged);
  }
  next_try_ns_ = now_ns() + kRetry;
}

bool LiveCamera::wait_for_device(std::int64_t deadline_ns) noexcept {
  for (;;) {
    base::system_clock().sleep_until(std::min(deadline_ns, next_try_ns_));
    if (now_ns() < next_try_ns_) return false;
    const bool connected = try_connect();
    next_try_ns_ = now_ns() + kRetry;
    if (connected) return true;
  }
}

void LiveCamera::will_read(const Area& area) noexcept {
  area_ = area;
  if (connection_) connection_->decoder.will_read(area);
}

GrabStatus LiveCamera::grab(Frame& out, std::chrono::nanoseconds timeout) noexcept {
  const std::int64_t deadline = now_ns() + timeout.count();
  for (;;) {
    if (!connection_ && !wait_for_device(deadline)) return GrabStatus::unplugged;
    switch (collect(out)) {
      case Collected::frame:
        return GrabStatus::ok;
      case Collected::damaged:
        note_damage(now_ns());
        return GrabStatus::damaged;
      case Collected::lost:
        lose("was unplugged or its driver failed");
        continue;
      case Collected::nothing:
        break;
    }
    const std::int64_t now = now_ns();
    note_silence(now);
    if (!connection_) continue;
    if (now >= deadline) return GrabStatus::timeout;
    // Awake when the silence becomes a stall, so that it is seen whatever the timeout is.
    const std::int64_t stall = now + tolerated_silence_ns() - silence_ns(now);
    connection_->source->wait(stall > now ? std::min(deadline, stall) : deadline);
  }
}

LiveCamera::Collected LiveCamera::collect(Frame& out) noexcept {
  Source& source = *connection_->source;
  // The newest whole frame, and the one before in case that the newest cannot be decoded.
  std::array<std::pair<FilledBuffer, std::uint64_t>, 2> whole;  // with its sequence; oldest first
  std::size_t count = 0;
  bool damaged = false;
  for (unsigned taken = 0; taken < kMaxTaken; ++taken) {
    FilledBuffer filled;
    const Collected got = take(filled);
    if (got == Collected::nothing) break;
    if (got == Collected::lost) return Collected::lost;
    const PayloadStatus payload = connection_->decoder.inspect(filled);
    int index_to_requeue = filled.index;
    if (payload != PayloadStatus::ok) {
      count_damage(payload);
      damaged = true;
    } else if (count < whole.size()) {
      whole[count++] = {filled, sequence_};
      continue;
    } else {
      index_to_requeue = whole[0].first.index;
      whole[0] = std::exchange(whole[1], {filled, sequence_});
      add(counters_.skipped);
    }
    if (!source.enqueue(index_to_requeue)) return Collected::lost;
  }
  bool done = false;
  for (std::size_t i = count; i-- > 0;) {
    const auto& [filled, sequence] = whole[i];
    if (done) {
      add(counters_.skipped);
    } else {
      bool kept = false;
      const PayloadStatus status =
          leases_.deliver(connection_->decoder, filled, facts_of(filled, sequence), out, kept);
      done = status == PayloadStatus::ok;
      if (done) {
        note_delivery();
      } else {
        count_damage(status);
      }
      damaged = damaged || !done;
      if (kept) continue;
    }
    // A frame that was delivered stays delivered: the next call meets the error again.
    if (!source.enqueue(filled.index) && !done) return Collected::lost;
  }
  if (done) return Collected::frame;
  return damaged ? Collected::damaged : Collected::nothing;
}

LiveCamera::Collected LiveCamera::take(FilledBuffer& out) noexcept {
  switch (connection_->source->dequeue(out)) {
    case DequeueStatus::failed:
      return Collected::lost;
    case DequeueStatus::none:
      buffers_free_ = connection_->source->queued();
      taken_in_a_row_ = 0;
      return Collected::nothing;
    case DequeueStatus::filled:
      break;
  }
  last_buffer_ns_ = now_ns();
  count_gap(out.sequence);
  // A single waiting buffer is the ordinary case, even if the driver has no other.
  driver_was_full_ = ++taken_in_a_row_ >= std::max(2, buffers_free_);
  return Collected::frame;
}

FrameInfo LiveCamera::facts_of(const FilledBuffer& filled, std::uint64_t sequence) const noexcept {
  FrameInfo frame;
  frame.sequence = sequence;
  frame.timestamp_ns = filled.timestamp_ns;
  frame.meaning = filled.meaning;
  frame.ready_ns = last_buffer_ns_;
  frame.flags = after_gap_ ? kFrameAfterGap : kFrameNormal;
  if (reopened_) frame.flags |= kFrameReopened;
  if (controls_moved_.load(std::memory_order_relaxed)) frame.flags |= kFrameControlsMoved;
  return frame;
}

void LiveCamera::note_delivery() noexcept {
  after_gap_ = false;
  reopened_ = false;
  delivered_ns_ = last_buffer_ns_;
  add(counters_.delivered);
  if (state_.load(std::memory_order_relaxed) == CameraState::streaming) return;
  const std::lock_guard guard(mutex_);
  state_.store(CameraState::streaming);
  fix_.clear();
}

void LiveCamera::count_gap(std::uint32_t counted) noexcept {
  // The driver's count begins anew with every connection, and within one with some drivers; ours
  // goes on.
  std::uint32_t step = last_counted_ ? counted - *last_counted_ : 1;
  if (step == 0 || step > kPlausibleGap) step = 1;
  last_counted_ = counted;
  sequence_ += step;
  if (step > 1 && driver_was_full_) {
    add(counters_.skipped, step - 1);
  } else if (step > 1) {
    add(counters_.lost, step - 1);
    after_gap_ = true;
  }
}

void LiveCamera::count_damage(PayloadStatus status) noexcept {
  damage_reason_.store(status == PayloadStatus::undecodable ? connection_->decoder.damage()
                                                            : nullptr);
  switch (status) {
    case PayloadStatus::flagged:
      return add(counters_.flagged);
    case PayloadStatus::markers:
      return add(counters_.markers);
    case PayloadStatus::too_short:
      return add(counters_.too_short);
    case PayloadStatus::undecodable:
      return add(counters_.undecodable);
    case PayloadStatus::ok:
      return;
  }
}

std::int64_t LiveCamera::silence_ns(std::int64_t now) const noexcept {
  return now - (last_buffer_ns_ == 0 ? opened_ns_ : last_buffer_ns_);
}

std::int64_t LiveCamera::tolerated_silence_ns() const noexcept {
  return last_buffer_ns_ == 0 ? std::max(kFirstFrame, stall_ns(period_ns_)) : stall_ns(period_ns_);
}

void LiveCamera::note_silence(std::int64_t now) noexcept {
  const std::int64_t silent = silence_ns(now);
  if (silent < tolerated_silence_ns()) return;
  if (state_.load() != CameraState::stalled) stall("sends nothing");
  if (silent >= kReopenAfter) restart(now);
}

void LiveCamera::note_damage(std::int64_t now) noexcept {
  if (now - delivered_ns_ < std::max(kReopenAfter, stall_ns(period_ns_))) return;
  stall("sends damaged frames only");
  restart(now);
}

void LiveCamera::stall(const char* what) noexcept {
  const std::lock_guard guard(mutex_);
  state_.store(CameraState::stalled);
  try {
    fix_ = fmt::format(
        "{} is attached but {}: it is restarted every {} s; if that doesn't help, plug it in again",
        info_.identity, what, kReopenAfter / 1'000'000'000);
  } catch (const std::exception&) {
    fix_.clear();
  }
}

void LiveCamera::restart(std::int64_t now) noexcept {
  std::shared_ptr<Connection> old;
  {
    const std::lock_guard guard(mutex_);
    old = std::exchange(connection_, nullptr);
    leases_.use(nullptr);
  }
  old->source->stop();
  next_try_ns_ = now;
}

void LiveCamera::change(const CameraChange& change) {
  const std::lock_guard controls_guard(controls_mutex_);
  std::unique_lock guard(mutex_);
  if (!connection_) throw DeviceError(state_.load(), fix_);
  // Again where the camera has been opened anew meanwhile, without the change. While it is away,
  // the next connection gets it.
  while (std::shared_ptr<Connection> held = connection_) {
    std::vector<CameraControl> controls = info_.controls;
    CameraSettings settings = info_.settings;
    guard.unlock();
    held->source->change(change, controls, settings);
    const Connection* changed = held.get();
    held.reset();  // may close the device: not under the mutex
    guard.lock();
    if (change.exposure_us) changed_.exposure_us = change.exposure_us;
    if (change.gain) changed_.gain = change.gain;
    if (changed != connection_.get()) continue;
    info_.controls = std::move(controls);
    info_.settings = settings;
    return;
  }
}

void LiveCamera::watch_controls() noexcept {
  std::unique_lock guard(mutex_);
  while (!wake_watcher_.wait_for(guard, kWatchPeriod, [this] { return stopping_; })) {
    guard.unlock();
    const std::lock_guard controls_guard(controls_mutex_);
    guard.lock();
    std::shared_ptr<Connection> held = connection_;
    if (!held) {
      // What is said of controls was of a camera that has gone.
      moved_.clear();
      controls_moved_.store(false);
      continue;
    }
    try {
      std::vector<CameraControl> controls = info_.controls;
      guard.unlock();
      std::string moved = held->source->check_controls(controls);
      const Connection* checked = held.get();
      held.reset();  // may close the device: not under the mutex
      guard.lock();
      const bool same = checked == connection_.get();
      if (!same) moved.clear();
      controls_moved_.store(!moved.empty());
      moved_ = std::move(moved);
      if (same) info_.controls = std::move(controls);
    } catch (const std::exception&) {
      if (!guard.owns_lock()) guard.lock();  // no memory; tried again in a second
    }
  }
}

}  // namespace dtact::hal::live
