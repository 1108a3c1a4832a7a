#include "hal/replay/replay_camera.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <stdexcept>
#include <string>

namespace dtact::hal::replay {

ReplayCamera::ReplayCamera(const CameraConfig& config, base::Clock& clock)
    : config_(config),
      clock_(clock),
      recording_(load_recording(config.replay.folder)),
      decode_scale_(config.decode_scale),
      decoder_(recording_.width, recording_.height, recording_.is_jpeg() ? decode_scale_ : 1) {
  const std::string wrong = mjpeg::scale_error(decode_scale_, pixel_format());
  if (!wrong.empty()) throw std::invalid_argument(wrong);
  const auto count = static_cast<double>(recording_.count());
  if (recording_.offsets_ns.size() > 1) {
    const auto last = static_cast<double>(recording_.offsets_ns.back());
    fps_ = (count - 1) * 1e9 / last;
    round_ns_ = std::llround(last * count / (count - 1));
  } else {
    if (!(config.fps > 0)) {
      throw std::invalid_argument(
          "camera.fps: a recording without timestamps.csv needs a rate "
          "above 0");
    }
    fps_ = config.fps;
    round_ns_ = std::llround(count * 1e9 / fps_);
  }
  if (recording_.is_jpeg()) {
    for (auto& buffer : decoded_) {
      buffer =
          luma::LumaBuffer(recording_.width / decode_scale_, recording_.height / decode_scale_);
    }
  }
}

CameraInfo ReplayCamera::info() const {
  CameraInfo info;
  info.backend = "replay";
  info.identity = config_.replay.folder.string();
  info.pixel_format = pixel_format();
  info.width = recording_.width / decode_scale_;
  info.height = recording_.height / decode_scale_;
  info.decode_scale = decode_scale_;
  info.fps = fps_;
  info.light_delay_frames = 0;  // a recording shows no light of ours
  return info;
}

CameraReport ReplayCamera::report() const {
  CameraReport report;
  report.delivered = delivered_;
  report.skipped = skipped_;
  report.damaged = damaged_;
  if (!recording_.left_out.empty()) {
    report.fix = "not all of the recording is played: " + recording_.left_out;
  }
  if (const mjpeg::Status damage = damage_; damage != mjpeg::Status::ok) {
    report.damage_reason =
        fmt::format("{}: {}", recording_.names[damaged_frame_], mjpeg::describe(damage));
  }
  if (ended_) {
    report.state = CameraState::ended;
    report.fix = "the recording has been played: set camera.replay.loop = true to repeat it";
  }
  return report;
}

void check(const CameraConfig& config) {
  CameraConfig unpaced = config;
  unpaced.replay.paced = false;
  ReplayCamera camera(unpaced);
  camera.start();
  Frame first;
  if (camera.grab(first, {}) == GrabStatus::ok) return;
  throw std::runtime_error(camera.report().damage_reason + ": remove the frame or record it again");
}

void ReplayCamera::start() {
  began_ns_ = clock_.monotonic_ns();
  next_ = 0;
  ended_ = false;
}

std::int64_t ReplayCamera::due_ns(std::uint64_t sequence) const noexcept {
  const std::uint64_t count = recording_.count();
  const auto round = static_cast<std::int64_t>(sequence / count);
  const std::uint64_t frame = sequence % count;
  const std::int64_t offset = recording_.offsets_ns.empty()
                                  ? std::llround(static_cast<double>(frame) * 1e9 / fps_)
                                  : recording_.offsets_ns[frame];
  return began_ns_ + round * round_ns_ + offset;
}

std::uint64_t ReplayCamera::newest_due(std::int64_t now_ns) const noexcept {
  const std::uint64_t count = recording_.count();
  const std::int64_t passed = std::max<std::int64_t>(0, now_ns - began_ns_);
  // Begin where the round says or where it was last, then step: offsets within a round are not
  // evenly spaced.
  std::uint64_t sequence = std::max(next_, static_cast<std::uint64_t>(passed / round_ns_) * count);
  while (due_ns(sequence + 1) <= now_ns) ++sequence;
  return config_.replay.loop ? sequence : std::min<std::uint64_t>(sequence, count - 1);
}

GrabStatus ReplayCamera::grab(Frame& out, std::chrono::nanoseconds timeout) noexcept {
  if (!config_.replay.loop && next_ >= recording_.count()) {
    ended_ = true;
    return GrabStatus::ended;
  }
  std::int64_t now_ns = clock_.monotonic_ns();
  if (config_.replay.paced) {
    const std::int64_t due = due_ns(next_);
    if (due > now_ns + timeout.count()) {
      clock_.sleep_until(now_ns + timeout.count());
      return GrabStatus::timeout;
    }
    if (due > now_ns) clock_.sleep_until(due);
    now_ns = clock_.monotonic_ns();
    if (const std::uint64_t newest = newest_due(now_ns); newest > next_) {
      skipped_ += newest - next_;
      next_ = newest;
    }
  }
  FrameInfo info;
  info.sequence = next_++;
  // When it is due, not when the caller woke up: being late is the caller's latency.
  info.ready_ns = config_.replay.paced ? due_ns(info.sequence) : now_ns;
  info.timestamp_ns = info.ready_ns;
  info.meaning = TimestampMeaning::arrival;
  return lend(out, info);
}

GrabStatus ReplayCamera::lend(Frame& out, FrameInfo info) noexcept {
  const std::size_t frame = info.sequence % recording_.count();
  if (!recording_.is_jpeg()) {
    ++delivered_;
    out = Frame(*this, 0, recording_.images[frame].view(), info);
    return GrabStatus::ok;
  }
  const std::int64_t began_ns = clock_.monotonic_ns();
  const std::string& payload = recording_.payloads[frame];
  luma::LumaBuffer& buffer = decoded_[static_cast<std::size_t>(next_buffer_)];
  const std::span jpeg(reinterpret_cast<const std::uint8_t*>(payload.data()), payload.size());
  const auto status = decoder_.decode(jpeg, buffer.data(), buffer.stride());
  if (status != mjpeg::Status::ok) {
    ++damaged_;
    damaged_frame_ = frame;
    damage_ = status;
    return GrabStatus::damaged;
  }
  info.decode_ns = clock_.monotonic_ns() - began_ns;
  ++delivered_;
  out = Frame(*this, next_buffer_, buffer.view(), info, jpeg);
  next_buffer_ = 1 - next_buffer_;
  return GrabStatus::ok;
}

}  // namespace dtact::hal::replay
