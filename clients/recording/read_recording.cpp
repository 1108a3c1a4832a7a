#include "clients/recording/read_recording.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <utility>

#include "clients/recording/channels.hpp"
#include "clients/recording/foxglove.pb.h"

namespace dtact::recording {
namespace {

template <typename Type>
Type parse(const mcap::Channel& channel, const mcap::Message& message) {
  Type parsed;
  if (!parsed.ParseFromArray(message.data.data(), static_cast<int>(message.data.size()))) {
    throw mcap::Error(fmt::format("{}: message {} is no {}", channel.topic, message.sequence,
                                  Type::descriptor()->full_name()));
  }
  return parsed;
}

/// The topic is there and its messages are `schema`'s.
bool holds(const mcap::Reader& file, const char* topic, const std::string& schema) {
  return std::ranges::any_of(file.channels(), [&](const auto& entry) {
    const auto found = file.schemas().find(entry.second.schema);
    return entry.second.topic == topic && entry.second.message_encoding == "protobuf" &&
           found != file.schemas().end() && found->second.name == schema;
  });
}

}  // namespace

void read_recording(const mcap::Reader& file, const RecordingHandlers& handlers) {
  if (!holds(file, kFrameTopic, v1::Frame::descriptor()->full_name())) {
    throw mcap::Error(fmt::format("no {} of dtact.v1.Frame in it: name a file of dtactctl record{}",
                                  kFrameTopic,
                                  file.damage().empty() ? "" : " (" + file.damage() + ")"));
  }
  std::set<std::string> topics;
  if (handlers.frame) topics.insert({kFrameTopic, kCameraTopic});
  if (handlers.event) topics.insert(kEventTopic);
  if (handlers.status) topics.insert(kStatusTopic);
  // A frame's JPEG stands before it.
  std::pair<std::uint64_t, std::string> jpeg;
  file.read(topics, [&](const mcap::Channel& channel, const mcap::Message& message) {
    if (channel.topic == kCameraTopic) {
      foxglove::CompressedImage image = parse<foxglove::CompressedImage>(channel, message);
      jpeg = {message.log_time, std::move(*image.mutable_data())};
      return true;
    }
    if (channel.topic == kEventTopic) {
      return handlers.event(parse<v1::Event>(channel, message), message.log_time);
    }
    if (channel.topic == kStatusTopic) {
      return handlers.status(parse<v1::Status>(channel, message), message.log_time);
    }
    auto frame = parse<v1::Frame>(channel, message);
    if (jpeg.first == message.log_time && !jpeg.second.empty()) {
      frame.mutable_jpeg()->set_data(std::move(jpeg.second));
      jpeg = {};
    }
    return handlers.frame(frame, message.log_time);
  });
}

std::optional<mcap::AttachmentPlace> find_attachment(const mcap::Reader& file,
                                                     const std::string& name,
                                                     std::uint64_t log_time) {
  std::optional<mcap::AttachmentPlace> found;
  for (const mcap::AttachmentPlace& place : file.attachments()) {
    if (place.name != name) continue;
    if (!found || place.log_time <= log_time) found = place;
  }
  return found;
}

}  // namespace dtact::recording
