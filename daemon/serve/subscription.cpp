#include "daemon/serve/subscription.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "proto/depth_encoding.hpp"
#include "proto/dtact.pb.h"

namespace dtact::net {
namespace {

constexpr std::uint32_t kMaxPresses = 10;  // joined in one recognition

Refusal invalid(std::string sentence) { return {v1::ERROR_INVALID, std::move(sentence)}; }

std::optional<Refusal> check_encodings(const v1::Subscribe& request) {
  if (request.depth() != v1::DEPTH_NONE && !wire::is_depth_encoding(request.depth())) {
    return Refusal{v1::ERROR_UNSUPPORTED,
                   fmt::format("subscribe.depth: this daemon does not know encoding {}: update "
                               "dtactd",
                               static_cast<int>(request.depth()))};
  }
  if (!v1::LumaEncoding_IsValid(request.luma())) {
    return Refusal{v1::ERROR_UNSUPPORTED,
                   fmt::format("subscribe.luma: this daemon does not know encoding {}: update "
                               "dtactd",
                               static_cast<int>(request.luma()))};
  }
  return std::nullopt;
}

std::optional<Refusal> check_parts(const v1::Subscribe& request, Serves serves) {
  const bool images =
      request.depth() != v1::DEPTH_NONE || request.luma() != v1::LUMA_NONE || request.jpeg();
  const bool geometry =
      request.cloud() != v1::CLOUD_NONE || request.pose() || request.recognition();
  if (serves == Serves::images && geometry) {
    return Refusal{
        v1::ERROR_UNSUPPORTED,
        "subscribe.cloud, pose and recognition: dtactd makes none of them; connect to the "
        "dtact-perceive that runs beside it, port 7378 unless configured"};
  }
  if (serves == Serves::geometry && images) {
    return Refusal{v1::ERROR_UNSUPPORTED,
                   "subscribe.depth, luma and jpeg: dtact-perceive passes none on; subscribe to "
                   "them at dtactd itself"};
  }
  if (!v1::CloudEncoding_IsValid(request.cloud())) {
    return Refusal{v1::ERROR_UNSUPPORTED,
                   fmt::format("subscribe.cloud: encoding {} is not known: update dtact-perceive",
                               static_cast<int>(request.cloud()))};
  }
  return std::nullopt;
}

std::optional<Refusal> check_rates(const v1::Subscribe& request) {
  const std::array<std::pair<const char*, double>, 7> rates{
      {{"depth_hz", request.depth_hz()},
       {"luma_hz", request.luma_hz()},
       {"jpeg_hz", request.jpeg_hz()},
       {"summary_hz", request.summary_hz()},
       {"cloud_hz", request.cloud_hz()},
       {"pose_hz", request.pose_hz()},
       {"recognition_hz", request.recognition_hz()}}};
  for (const auto& [name, hz] : rates) {
    // Not by what is outside, since that is false of NaN.
    if (hz == 0 || (hz >= 0.01 && hz <= 1000)) continue;
    return invalid(
        fmt::format("subscribe.{}: {}; allowed are 0 (no limit) and 0.01 to 1000", name, hz));
  }
  return std::nullopt;
}

std::optional<Refusal> check_map(const v1::Subscribe& request, Subscription::Map map) {
  const auto one_of = [](std::uint32_t value, auto... allowed) {
    return value == 0 || ((value == static_cast<std::uint32_t>(allowed)) || ...);
  };
  if (!one_of(request.decimation(), 1, 2, 4)) {
    return invalid(fmt::format("subscribe.decimation: {}; allowed are 1, 2 and 4, and 0 for 1",
                               request.decimation()));
  }
  if (!one_of(request.um_per_unit(), 1, 2, 5, 10)) {
    return invalid(fmt::format("subscribe.um_per_unit: {}; allowed are 1, 2, 5 and 10, and 0 for 1",
                               request.um_per_unit()));
  }
  if (request.recognition_presses() > kMaxPresses) {
    return invalid(
        fmt::format("subscribe.recognition_presses: {}; allowed are 1 to {}, and 0 for 1",
                    request.recognition_presses(), kMaxPresses));
  }
  if (!request.has_box()) return std::nullopt;
  const auto& box = request.box();
  if (box.width() == 0 || box.height() == 0) {
    return invalid(fmt::format("subscribe.box: {}x{} pixels; width and height are at least 1",
                               box.width(), box.height()));
  }
  if (map.width > 0 && (box.x() >= map.width || box.y() >= map.height)) {
    return invalid(
        fmt::format("subscribe.box: it begins at {}, {}, and the depth map has {}x{} "
                    "pixels",
                    box.x(), box.y(), map.width, map.height));
  }
  return std::nullopt;
}

}  // namespace

RateLimit::RateLimit(double hz) : period_ns_(hz > 0 ? std::llround(1e9 / hz) : 0) {}

bool RateLimit::admits(std::int64_t timestamp_ns, std::int64_t spacing_ns) noexcept {
  if (period_ns_ == 0) return true;
  // It is at most 1.5 periods after the last frame let through. A time further back is another
  // clock's: the daemon's machine restarted behind a program that passes frames on.
  if (next_ns_ != INT64_MIN && timestamp_ns < next_ns_ - 2 * period_ns_) next_ns_ = INT64_MIN;
  if (next_ns_ != INT64_MIN) {
    // The next frame would lie further from the time than this one does.
    const std::int64_t near_ns = std::min(spacing_ns, period_ns_) / 2;
    if (timestamp_ns + near_ns < next_ns_) return false;
  }
  const std::int64_t earliest_ns = timestamp_ns + period_ns_;
  const bool on_time =
      next_ns_ != INT64_MIN && timestamp_ns - next_ns_ < std::min(spacing_ns, period_ns_);
  next_ns_ = on_time ? next_ns_ + period_ns_ : earliest_ns;
  return true;
}

std::variant<Subscription, Refusal> Subscription::from(const v1::Subscribe& request, Map map,
                                                       Serves serves) {
  for (const auto& refusal : {check_parts(request, serves), check_encodings(request),
                              check_rates(request), check_map(request, map)}) {
    if (refusal) return *refusal;
  }
  Subscription made;
  made.kind_ = {.depth = request.depth(),
                .spec = {.decimation = std::max(1, static_cast<int>(request.decimation())),
                         .um_per_unit = std::max(1, static_cast<int>(request.um_per_unit()))},
                .contact_box = request.contact_box(),
                .luma = request.luma(),
                .jpeg = request.jpeg(),
                .cloud = request.cloud(),
                .pose = request.pose(),
                .recognition = std::max(1, static_cast<int>(request.recognition_presses()))};
  if (request.has_box()) {
    const auto& box = request.box();
    made.kind_.spec.region = DepthRegion{box.x(), box.y(), box.width(), box.height()};
  }
  const auto ask = [&made](bool wanted, Parts part, RateLimit& limit, double hz) {
    if (!wanted) return;
    made.parts_ |= part;
    limit = RateLimit(hz);
    made.unlimited_ = made.unlimited_ || !limit.limits();
  };
  ask(request.depth() != v1::DEPTH_NONE, kDepth, made.depth_, request.depth_hz());
  ask(request.luma() != v1::LUMA_NONE, kLuma, made.luma_, request.luma_hz());
  ask(request.jpeg(), kJpeg, made.jpeg_, request.jpeg_hz());
  ask(request.cloud() != v1::CLOUD_NONE, kCloud, made.cloud_, request.cloud_hz());
  ask(request.pose(), kPose, made.pose_, request.pose_hz());
  ask(request.recognition(), kRecognition, made.recognition_, request.recognition_hz());
  ask(request.summary(), kSummary, made.summary_, request.summary_hz());
  made.every_ = std::max(1U, request.every());
  made.events_ = !request.has_events() || request.events();
  return made;
}

Subscription::Due Subscription::next(std::int64_t timestamp_ns, std::uint64_t missed) noexcept {
  if (parts_ == 0) return {};
  // The first frame is one of those, then every n-th.
  const auto left = [this] { return (offered_ + every_ - 1) / every_; };
  const std::uint64_t before = left();
  offered_ += missed;
  Due due;
  // Frames left out by the rate limit do not count as missed: a later one is sent instead.
  if (unlimited_) due.missed = left() - before;
  if (offered_++ % every_ != 0) return due;
  const std::int64_t spacing_ns =
      last_ns_ == 0 ? 0 : std::max<std::int64_t>(0, timestamp_ns - last_ns_);
  last_ns_ = timestamp_ns;
  const auto ask = [&](Parts part, RateLimit& limit) {
    if ((parts_ & part) != 0 && limit.admits(timestamp_ns, spacing_ns)) due.parts |= part;
  };
  ask(kSummary, summary_);
  ask(kDepth, depth_);
  ask(kLuma, luma_);
  ask(kJpeg, jpeg_);
  ask(kCloud, cloud_);
  ask(kPose, pose_);
  ask(kRecognition, recognition_);
  return due;
}

FrameKind Subscription::kind(Parts parts) const {
  FrameKind kind;
  if ((parts & (kDepth | kCloud)) != 0) {
    if ((parts & kDepth) != 0) kind.depth = kind_.depth;
    if ((parts & kCloud) != 0) kind.cloud = kind_.cloud;
    kind.spec = kind_.spec;
    kind.contact_box = kind_.contact_box;
  }
  if ((parts & kLuma) != 0) kind.luma = kind_.luma;
  kind.jpeg = (parts & kJpeg) != 0;
  kind.pose = (parts & kPose) != 0;
  if ((parts & kRecognition) != 0) kind.recognition = kind_.recognition;
  return kind;
}

}  // namespace dtact::net
