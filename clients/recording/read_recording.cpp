#include "clients/recording/read_recording.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "clients/recording/channels.hpp"
#include "clients/recording/foxglove.pb.h"

namespace dtact::recording {
namespace {

/// None for a message that is no `Type`, which `file` then counts as unreadable.
template <typename Type>
std::optional<Type> parse(const mcap::Reader& file, const mcap::Channel& channel,
                          const mcap::Message& message) {
  Type parsed;
  if (parsed.ParseFromArray(message.data.data(), static_cast<int>(message.data.size()))) {
    return parsed;
  }
  file.count_unreadable(fmt::format("{}: message {} is no {}", channel.topic, message.sequence,
                                    Type::descriptor()->full_name()));
  return std::nullopt;
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
  // A frame's JPEG stands before it, and with other writers some others between them.
  constexpr std::size_t kWaiting = 8;
  std::map<std::uint64_t, std::string> jpegs;  // by log time
  bool any = false;
  file.read(topics, [&](const mcap::Channel& channel, const mcap::Message& message) {
    if (channel.topic == kCameraTopic) {
      if (auto image = parse<foxglove::CompressedImage>(file, channel, message)) {
        jpegs[message.log_time] = std::move(*image->mutable_data());
        if (jpegs.size() > kWaiting) jpegs.erase(jpegs.begin());
      }
      return true;
    }
    if (channel.topic == kEventTopic) {
      const auto event = parse<v1::Event>(file, channel, message);
      return !event || handlers.event(*event, message.log_time);
    }
    if (channel.topic == kStatusTopic) {
      const auto status = parse<v1::Status>(file, channel, message);
      return !status || handlers.status(*status, message.log_time);
    }
    auto frame = parse<v1::Frame>(file, channel, message);
    if (!frame) return true;
    any = true;
    if (auto jpeg = jpegs.extract(message.log_time); jpeg && !jpeg.mapped().empty()) {
      frame->mutable_jpeg()->set_data(std::move(jpeg.mapped()));
    }
    return handlers.frame(*frame, message.log_time);
  });
  if (handlers.frame && !any && !file.damage().empty()) {
    throw mcap::Error("no frame of it can be read: " + file.damage());
  }
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
