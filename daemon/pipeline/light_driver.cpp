#include "daemon/pipeline/light_driver.hpp"

#include <chrono>
#include <exception>
#include <utility>

namespace dtact::pipeline {
namespace {

constexpr std::int64_t kRetryNs = 5'000'000;

}  // namespace

LightDriver::LightDriver(std::unique_ptr<hal::LightRing> ring, const hal::Light& light,
                         base::Clock& clock, const Exchange& exchange, hal::Camera* camera)
    : ring_(std::move(ring)),
      info_(ring_->info()),
      clock_(clock),
      exchange_(exchange),
      camera_(camera),
      light_(light),
      requested_(light) {}

void LightDriver::start() {
  stop_ = false;
  (void)write(light());
  thread_ = base::RtThread({.name = "dtact-light", .cpu = {}}, [this] { run(); });
}

void LightDriver::stop() noexcept {
  stop_ = true;
  work_.ring();
  thread_.join();
  ring_.reset();
}

bool LightDriver::submit(Command command) {
  {
    const std::scoped_lock lock(mutex_);
    std::optional<hal::Light> light;
    if (const auto* set = std::get_if<SetLight>(&command.what)) light = set->light;
    if (!commands_.push(std::move(command))) return false;
    if (light) {
      requested_ = *light;
      ++waiting_;
    }
  }
  work_.ring();
  return true;
}

std::string LightDriver::message() const {
  const std::scoped_lock lock(mutex_);
  return message_.empty() ? note_ : message_;
}

hal::Light LightDriver::light() const {
  const std::scoped_lock lock(mutex_);
  return light_;
}

hal::Light LightDriver::requested() const {
  const std::scoped_lock lock(mutex_);
  return requested_;
}

std::optional<std::int64_t> LightDriver::light_since_ns() const {
  const std::int64_t lag_ns = exchange_.light_lag_ns.load(std::memory_order_relaxed);
  const std::scoped_lock lock(mutex_);
  if (lag_ns < 0 || !shown_ns_) return std::nullopt;
  return *shown_ns_ + lag_ns;
}

void LightDriver::run() {
  std::chrono::nanoseconds due{};
  while (!stop_) {
    if (!work_.wait_for(due.count())) due = attend();
    Command command;
    while (!stop_ && commands_.pop(command)) serve(std::move(command));
  }
}

void LightDriver::set_camera(Command command) {
  CommandDone done;
  note({.begins = true, .at_ns = clock_.monotonic_ns(), .light = light()});
  bool changed = true;
  try {
    camera_->change(std::get<SetCamera>(command.what).change);
  } catch (const std::exception& e) {
    changed = false;
    done.outcome = Outcome::device_error;
    done.message = e.what();
  }
  // A light that is not known stays so.
  note({.begins = false,
        .at_ns = clock_.monotonic_ns(),
        .light = light(),
        .failed = !shown_ns_.has_value(),
        .camera = changed});
  done.command = std::move(command);
  emit(done);
}

void LightDriver::serve(Command command) {
  if (std::holds_alternative<SetCamera>(command.what)) return set_camera(std::move(command));
  const hal::Light before = light();
  const hal::Light wanted = std::get<SetLight>(command.what).light;
  const hal::ShowResult result = write(wanted);
  {
    const std::scoped_lock lock(mutex_);
    if (--waiting_ == 0 && !result.ok && !result.away) requested_ = light_;
  }
  CommandDone done{.command = std::move(command), .message = result.message};
  if (result.away) {
    done.outcome = Outcome::ring_away;
    done.message += ". The light is kept and shown when the ring is back";
  } else if (!result.ok) {
    done.outcome = Outcome::device_error;
  } else {
    done.light_since_ns = light_since_ns();
  }
  emit(done);
  if (result.ok && wanted != before) emit(changed());
}

/// The event for the write that has just succeeded.
LightChanged LightDriver::changed() const {
  const std::int64_t passed_ns = clock_.monotonic_ns() - shown_ns_.value_or(0);
  return {.light = light_,
          .at = {.sequence = exchange_.sequence.load(std::memory_order_relaxed),
                 .monotonic_ns = shown_ns_.value_or(0),
                 .wall_ns = clock_.wall_ns() - passed_ns},
          .since_ns = light_since_ns()};
}

std::chrono::nanoseconds LightDriver::attend() {
  const hal::RingReport report = ring_->attend(light());
  {
    const std::scoped_lock lock(mutex_);
    note_ = report.note;
  }
  if (report.away) {
    away_ = true;
    const std::scoped_lock lock(mutex_);
    shown_ns_.reset();
  } else if (away_) {
    come_back();
    return report.due;
  }
  // A ring that never re-sends knows nothing of how it is.
  if (report.away || (report.writes > 0 && report.ok == trouble_)) {
    trouble_ = !report.ok;
    {
      const std::scoped_lock lock(mutex_);
      message_ = report.message;
    }
    if (report.ok && !shown_ns_) recover();
  }
  return report.due;
}

// Until this re-send the LEDs may have shown the light that failed, the one before, or a mixture.
void LightDriver::recover() {
  const std::int64_t now_ns = clock_.monotonic_ns();
  note({.begins = true, .at_ns = now_ns, .light = light()});
  {
    const std::scoped_lock lock(mutex_);
    shown_ns_ = now_ns;
  }
  note({.begins = false, .at_ns = now_ns, .light = light(), .returned = true});
}

void LightDriver::come_back() {
  const hal::Light before = light();
  const hal::Light kept = requested();
  if (!write(kept).ok) {
    away_ = true;  // so that it is tried again
  } else if (kept != before) {
    emit(changed());
  }
}

hal::ShowResult LightDriver::write(const hal::Light& light) {
  // The same bytes once more change no picture, as the ring's own re-sends.
  const bool again = shown_ns_ && !trouble_ && light == light_;
  const std::int64_t began_ns = clock_.monotonic_ns();
  if (!again) note({true, began_ns, light});
  hal::ShowResult result = ring_->show(light);
  if (again && result.ok) return result;
  if (again) note({true, began_ns, light});
  trouble_ = !result.ok;
  const bool was_away = std::exchange(away_, result.away);
  const std::int64_t ended_ns = clock_.monotonic_ns();
  hal::Light shown;
  {
    const std::scoped_lock lock(mutex_);
    if (result.ok) light_ = light;
    shown_ns_.reset();
    if (result.ok) shown_ns_ = ended_ns;
    shown = light_;
    message_ = result.message;
  }
  note({false, ended_ns, shown, was_away && result.ok, !result.ok});
  return result;
}

void LightDriver::note(const LightNote& note) {
  while (!notes_.push(LightNote(note)) && !stop_) {
    clock_.sleep_until(clock_.monotonic_ns() + kRetryNs);
  }
}

void LightDriver::emit(const Event& event) {
  while (!events_.push(Event(event)) && !stop_) {
    clock_.sleep_until(clock_.monotonic_ns() + kRetryNs);
  }
  exchange_.wake.signal();
}

}  // namespace dtact::pipeline
