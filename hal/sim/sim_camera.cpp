#include "hal/sim/sim_camera.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cmath>
#include <ctime>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "hal/luma/luma.hpp"
#include "hal/mjpeg/grey_decoder.hpp"
#include "hal/sim/device.hpp"
#include "hal/sim/payload.hpp"

namespace dtact::hal::sim {
namespace {

/// How often a call that the scene has hang looks whether it may return.
constexpr std::int64_t kHangStep = 5'000'000;

/// A camera of the simulation exposes for this long where a scene says 1; the gain beside it and
/// the range are such that the product stays within what the renderer does.
constexpr double kExposureUs = 10'000;
constexpr double kMinExposure = 0.25;
constexpr double kMaxExposure = 2;
constexpr double kMaxGain = 2;

Scene configured_scene(const CameraConfig& config) {
  const Scene scene = config.sim.scene.empty() ? default_scene() : load_scene(config.sim.scene);
  return at_mode(scene, config.width, config.height, config.fps);
}

CameraControl control(const char* name, double value) {
  return {name, std::llround(value * 1000), ControlVerdict::confirmed};
}

// Waits until `fd` is readable or `ns` have passed, and clears it.
void wait_for(int fd, std::int64_t ns) noexcept {
  pollfd entry{fd, POLLIN, 0};
  const timespec limit{ns / 1'000'000'000, ns % 1'000'000'000};
  if (::ppoll(&entry, 1, &limit, nullptr) > 0) {
    std::uint64_t count = 0;
    (void)!::read(fd, &count, sizeof count);
  }
}

}  // namespace

class SimCamera::Impl {
 public:
  Impl(FrameOwner& frames, const CameraConfig& config, std::shared_ptr<LightLink> link,
       base::Clock& the_clock)
      : owner(frames),
        output(output_from_name(config.sim.output)),
        paced(config.sim.paced),
        decode_scale(config.decode_scale),
        clock(the_clock),
        device(configured_scene(config), config.sim.seed, output, std::move(link), the_clock) {
    const std::string wrong = mjpeg::scale_error(decode_scale, format());
    if (!wrong.empty()) throw std::runtime_error(wrong);
    for (auto& buffer : buffers) {
      buffer = luma::LumaBuffer(config.width / decode_scale, config.height / decode_scale);
    }
    if (output == Output::mjpeg) decoder.emplace(config.width, config.height, decode_scale);
  }

  /// As a camera's driver names it.
  [[nodiscard]] const char* format() const noexcept {
    return std::array{"GREY", "YUYV", "MJPEG"}[static_cast<std::size_t>(output)];
  }

  GrabStatus grab(Frame& out, std::int64_t timeout_ns) noexcept;
  GrabStatus hand_out(const Payload& payload, Frame& out) noexcept;
  bool decode(const Payload& payload, luma::LumaBuffer& buffer) noexcept;
  void give_back(int index) noexcept { lent[static_cast<std::size_t>(index)] = false; }

  FrameOwner& owner;
  const Output output;
  const bool paced;
  const int decode_scale;
  base::Clock& clock;
  Device device;
  std::optional<mjpeg::GreyDecoder> decoder;
  // The caller holds one frame at most: one more to decode into.
  std::array<luma::LumaBuffer, 2> buffers;
  std::array<bool, 2> lent{};

  // The grabbing thread's.
  std::uint64_t next_sequence = 0;
  std::uint64_t lost_seen = 0;
  std::uint64_t disconnects_seen = 0;
  // Values that info() and report() return to any thread.
  std::atomic<double> exposure{1};  // beside the scene's
  std::atomic<double> gain{1};
  std::atomic<std::uint64_t> delivered{0};
  std::atomic<std::uint64_t> lost{0};
  std::atomic<std::uint64_t> skipped{0};
  std::atomic<std::uint64_t> damaged{0};
};

GrabStatus SimCamera::Impl::grab(Frame& out, std::int64_t timeout_ns) noexcept {
  if (!paced) {
    for (;;) {
      if (const Payload* payload = device.make_next()) return hand_out(*payload, out);
      if (device.state() == CameraState::unplugged) return GrabStatus::unplugged;
      if (device.state() == CameraState::stalled) return GrabStatus::timeout;
    }
  }
  while (device.hangs()) clock.sleep_until(clock.monotonic_ns() + kHangStep);
  const std::int64_t latest = clock.monotonic_ns() + timeout_ns;
  for (;;) {
    // Reported once as soon as it happens; later calls wait for the device to come back.
    const std::uint64_t disconnects = device.disconnects();
    if (std::exchange(disconnects_seen, disconnects) != disconnects) {
      (void)device.take();  // what was on the cable went with it
      return GrabStatus::unplugged;
    }
    if (const Payload* payload = device.take()) return hand_out(*payload, out);
    const std::int64_t rest = latest - clock.monotonic_ns();
    if (rest <= 0) break;
    wait_for(device.event_fd(), rest);
  }
  return device.state() == CameraState::unplugged ? GrabStatus::unplugged : GrabStatus::timeout;
}

GrabStatus SimCamera::Impl::hand_out(const Payload& payload, Frame& out) noexcept {
  FrameInfo info;
  info.sequence = payload.sequence;
  info.timestamp_ns = payload.ready_ns;
  info.ready_ns = payload.ready_ns;
  info.meaning = TimestampMeaning::end_of_frame;

  const std::uint64_t gone = payload.lost_before - lost_seen;
  lost_seen = payload.lost_before;
  if (gone > 0) info.flags |= kFrameAfterGap;
  lost += gone;
  skipped += payload.sequence - next_sequence - gone;
  next_sequence = payload.sequence + 1;

  const std::size_t index = lent[0] ? 1 : 0;
  const std::int64_t begin = clock.monotonic_ns();
  if (!decode(payload, buffers[index])) {
    ++damaged;
    return GrabStatus::damaged;
  }
  info.decode_ns = clock.monotonic_ns() - begin;
  ++delivered;
  lent[index] = true;
  std::span<const std::uint8_t> jpeg;
  if (output == Output::mjpeg) jpeg = {payload.buffer.data(), payload.bytes};
  out = Frame(owner, static_cast<int>(index), buffers[index].view(), info, jpeg);
  return GrabStatus::ok;
}

bool SimCamera::Impl::decode(const Payload& payload, luma::LumaBuffer& buffer) noexcept {
  const std::span<const std::uint8_t> bytes(payload.buffer.data(), payload.bytes);
  switch (output) {
    case Output::luma:
      return luma::extract(luma::Layout::grey, luma::Range::full, bytes, 0, buffer) ==
             luma::ExtractStatus::ok;
    case Output::yuyv:
      return luma::extract(luma::Layout::yuyv, luma::Range::limited, bytes, 0, buffer) ==
             luma::ExtractStatus::ok;
    case Output::mjpeg:
      return decoder && decoder->decode(bytes, buffer.data(), buffer.stride()) == mjpeg::Status::ok;
  }
  return false;
}

void check(const CameraConfig& config) {
  const Scene scene = configured_scene(config);
  (void)PayloadEncoder(output_from_name(config.sim.output), scene.camera.width,
                       scene.camera.height);
}

SimCamera::SimCamera(const CameraConfig& config, std::shared_ptr<LightLink> link,
                     base::Clock& clock)
    : impl_(std::make_unique<Impl>(static_cast<FrameOwner&>(*this), config, std::move(link),
                                   clock)) {}

SimCamera::~SimCamera() = default;

void SimCamera::give_back(int index) noexcept { impl_->give_back(index); }

CameraInfo SimCamera::info() const {
  const Scene& scene = impl_->device.scene();
  CameraInfo info;
  info.backend = "sim";
  info.identity = "sim:" + scene.sensor;
  info.pixel_format = impl_->format();
  info.width = scene.camera.width / impl_->decode_scale;
  info.height = scene.camera.height / impl_->decode_scale;
  info.decode_scale = impl_->decode_scale;
  info.fps = scene.camera.fps;
  info.light_delay_frames = scene.camera.light_delay_frames;
  // The exposure as its effect, the gain included.
  const double exposure = impl_->exposure;
  const double gain = impl_->gain;
  info.controls = {control("exposure_permille", scene.camera.exposure * exposure * gain),
                   control("gamma_permille", scene.camera.gamma)};
  const double us = kExposureUs * scene.camera.exposure;
  info.settings = {.exposure_us = {{us * exposure, us * kMinExposure, us * kMaxExposure}},
                   .gain = {{gain, 1, kMaxGain}}};
  return info;
}

CameraReport SimCamera::report() const {
  CameraReport report;
  report.state = impl_->device.state();
  if (report.state == CameraState::unplugged) {
    report.fix =
        "the scene has unplugged the simulated camera: it comes back when the scripted fault "
        "ends, or take the [[fault]] out of the scene";
  } else if (report.state == CameraState::stalled) {
    report.fix =
        "the scene has stalled the simulated camera: it goes on when the scripted fault ends, or "
        "take the [[fault]] out of the scene";
  }
  report.delivered = impl_->delivered;
  report.lost = impl_->lost;
  report.skipped = impl_->skipped;
  report.damaged = impl_->damaged;
  report.disconnects = impl_->device.disconnects();
  return report;
}

void SimCamera::start() {
  if (impl_->paced) impl_->device.run_paced();
}

void SimCamera::change(const CameraChange& change) {
  if (change.exposure_us) {
    impl_->exposure = *change.exposure_us / kExposureUs / impl_->device.scene().camera.exposure;
  }
  if (change.gain) impl_->gain = *change.gain;
  impl_->device.set_brightness(impl_->exposure * impl_->gain);
}

void SimCamera::will_read(const Area& area) noexcept {
  if (auto& decoder = impl_->decoder) decoder->set_crop(area);
}

GrabStatus SimCamera::grab(Frame& out, std::chrono::nanoseconds timeout) noexcept {
  return impl_->grab(out, timeout.count());
}

}  // namespace dtact::hal::sim
