#include "hal/sim/device.hpp"

#include <sys/eventfd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <numeric>
#include <system_error>
#include <utility>

namespace dtact::hal::sim {

Device::Device(const Scene& scene, std::uint64_t seed, Output output,
               std::shared_ptr<LightLink> link, base::Clock& clock)
    : renderer_(scene, seed),
      encoder_(output, scene.camera.width, scene.camera.height),
      link_(std::move(link)),
      clock_(clock),
      image_(scene.camera.width, scene.camera.height),
      seen_(static_cast<std::size_t>(scene.camera.light_delay_frames), led_levels(link_->light())),
      event_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
  if (!event_) {
    const int error = errno;
    throw std::system_error(error, std::generic_category(),
                            "the simulated camera cannot make an eventfd");
  }
  for (Payload& payload : payloads_) payload.buffer.resize(encoder_.capacity());
}

Device::~Device() { stop_ = true; }

void Device::run_paced() {
  if (!std::exchange(paced_, true)) {
    base::RtSettings settings;
    settings.name = "dtact-sim";
    thread_ = base::RtThread(settings, [this] { loop(); });
  }
}

void Device::loop() {
  const std::int64_t period = std::llround(1e9 / scene().camera.fps);
  std::int64_t deadline = clock_.monotonic_ns() + period;
  while (!stop_) {
    Payload& payload = payloads_[writing_];
    const bool made = make(sequence_, payload);
    clock_.sleep_until(deadline);
    const std::int64_t now = clock_.monotonic_ns();
    if (made) {
      // The deadline, not the late wake-up: a camera's clock does not depend on the host's load.
      payload.ready_ns = std::max(deadline, now - period);
      writing_ = newest_.exchange(writing_ | kFresh, std::memory_order_acq_rel) & ~kFresh;
      wake();
    }
    ++sequence_;
    deadline += period;
    if (const std::int64_t late = (now - deadline) / period; now > deadline && late > 0) {
      sequence_ += static_cast<std::uint64_t>(late);
      deadline += late * period;
      // What was skipped was exposed all the same.
      for (std::int64_t i = std::min<std::int64_t>(late, std::ssize(seen_)); i > 0; --i) {
        (void)exposed_light();
      }
    }
  }
}

const Payload* Device::take() noexcept {
  if ((newest_.load(std::memory_order_relaxed) & kFresh) == 0) return nullptr;
  reading_ = newest_.exchange(reading_, std::memory_order_acq_rel) & ~kFresh;
  return &payloads_[reading_];
}

const Payload* Device::make_next() noexcept {
  Payload& payload = payloads_[writing_];
  if (!make(sequence_++, payload)) return nullptr;
  payload.ready_ns = clock_.monotonic_ns();
  return &payload;
}

bool Device::make(std::uint64_t sequence, Payload& payload) noexcept {
  const LedLevels light = exposed_light();
  const auto struck_by = [&](FaultKind kind) { return scene().strikes(kind, sequence); };
  hangs_ = struck_by(FaultKind::hang);
  if (struck_by(FaultKind::unplug)) {
    ++lost_;
    if (state_.exchange(CameraState::unplugged) != CameraState::unplugged) {
      ++disconnects_;
      wake();
    }
    return false;
  }
  state_ = struck_by(FaultKind::stall) ? CameraState::stalled : CameraState::streaming;
  if (hangs_ || struck_by(FaultKind::drop) || struck_by(FaultKind::stall)) {
    ++lost_;
    return false;
  }

  int rows = image_.height();
  if (struck_by(FaultKind::torn)) rows /= 2;
  if (struck_by(FaultKind::repeat)) rows = 0;
  renderer_.render(sequence, light, image_.data(), image_.stride(), rows);
  if (struck_by(FaultKind::covered)) cover(rows);
  regulate(struck_by(FaultKind::auto_exposure));
  payload.bytes = encoder_.encode(image_.view(), payload.buffer);
  if (struck_by(FaultKind::truncate)) payload.bytes /= 2;
  payload.sequence = sequence;
  payload.lost_before = lost_;
  return true;
}

void Device::cover(int rows) noexcept {
  for (int y = 0; y < rows; ++y) {
    std::uint8_t* const row = image_.data() + y * image_.stride();
    for (int x = 0; x < image_.width() / 3; ++x) row[x] = static_cast<std::uint8_t>(row[x] / 2);
  }
}

void Device::regulate(bool automatic) noexcept {
  if (!automatic) {
    kept_grey_ = 0;
    gain_ = 1;
    renderer_.set_gain(brightness_);
    return;
  }
  constexpr int kRowStep = 8;       // of the rows that it measures
  constexpr double kAFrame = 0.15;  // of what is missing is made up for with each frame
  const LumaView image = image_.view();
  std::int64_t sum = 0;
  int rows = 0;
  for (int y = 0; y < image.height; y += kRowStep, ++rows) {
    sum = std::accumulate(image.row(y), image.row(y) + image.width, sum);
  }
  const double grey = std::max(1.0, static_cast<double>(sum) / rows / image.width);
  if (kept_grey_ == 0) kept_grey_ = grey;
  gain_ = std::clamp(gain_ * (1 + kAFrame * (kept_grey_ / grey - 1)), 0.25, 4.0);
  renderer_.set_gain(brightness_ * gain_);
}

LedLevels Device::exposed_light() noexcept {
  std::rotate(seen_.rbegin(), seen_.rbegin() + 1, seen_.rend());
  seen_.front() = led_levels(link_->light());
  return mean(seen_[seen_.size() - 1], seen_[seen_.size() - 2]);
}

void Device::wake() noexcept {
  const std::uint64_t one = 1;
  // A full counter means that the reader has already been notified.
  (void)!::write(event_.get(), &one, sizeof one);
}

}  // namespace dtact::hal::sim
