#pragma once

#include <google/protobuf/descriptor.h>

#include <array>
#include <bitset>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "proto/dtact.pb.h"

// A sensor's channels for Foxglove: those of recordings, and some more for live viewing.
namespace dtact::web::foxglove {

enum class Topic : std::uint8_t {
  frame,
  summary,
  contact,
  light,
  event,
  depth,
  luma,
  jpeg,
  points,
  pose,
  recognition,
  transforms
};
inline constexpr std::size_t kTopics = 12;
using Topics = std::bitset<kTopics>;

struct TopicInfo {
  Topic topic;
  const char* name;  ///< "/dtact/frame"
  const google::protobuf::Descriptor* type;
};
/// In the order of Topic.
[[nodiscard]] const std::array<TopicInfo, kTopics>& topics();

inline constexpr std::size_t index(Topic topic) { return static_cast<std::size_t>(topic); }

/// Frames a second of each channel, at most.
inline constexpr double kMaxHz = 60;

/// What a daemon has messages of: dtactd maps and pictures, dtact-perceive points, poses and
/// recognition. None:
/// one that was never there, which is taken for dtactd.
[[nodiscard]] Topics served_by(const std::optional<v1::HelloReply>& daemon);

/// What the daemon has to send for these; nothing at all where events are enough.
[[nodiscard]] v1::Subscribe subscription_for(Topics wanted);

/// One message of a channel, for all who subscribed to it.
struct Message {
  std::uint64_t time_ns = 0;  ///< Since 1970, UTC, by the daemon's clock.
  std::string payload;        ///< Protobuf.
};

/// `frame` as a topic's message; null when it has nothing of that. Light and events are none of a
/// frame's own. Throws client::ProtocolError for a damaged map.
[[nodiscard]] std::shared_ptr<const Message> message_of(Topic topic, const v1::Frame& frame);
/// The frame's points: none of one that has none, as viewers show the last ones until the next.
[[nodiscard]] std::shared_ptr<const Message> points_of(const v1::Frame& frame);

}  // namespace dtact::web::foxglove
