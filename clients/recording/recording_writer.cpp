#include "clients/recording/recording_writer.hpp"

#include <algorithm>
#include <utility>

#include "clients/recording/channels.hpp"
#include "clients/recording/foxglove.pb.h"
#include "clients/recording/pictures.hpp"

namespace dtact::recording {

RecordingWriter::RecordingWriter(mcap::Sink& sink, const RecordingOptions& options)
    : writer_(sink, {.library = options.program}),
      picture_interval_ns_(
          options.pictures_hz > 0 ? static_cast<std::int64_t>(1e9 / options.pictures_hz) : 0),
      frame_(add_channel(kFrameTopic, *v1::Frame::descriptor())),
      event_(add_channel(kEventTopic, *v1::Event::descriptor())),
      light_(add_channel(kLightTopic, *v1::LightState::descriptor())),
      status_(add_channel(kStatusTopic, *v1::Status::descriptor())) {}

std::uint16_t RecordingWriter::add_channel(const char* topic,
                                           const google::protobuf::Descriptor& type,
                                           const std::map<std::string, std::string>& metadata) {
  return writer_.add_channel(writer_.add_schema(type.full_name(), "protobuf", schema_of(type)),
                             topic, "protobuf", metadata);
}

RecordingWriter::Moment RecordingWriter::moment_of(std::uint64_t sequence,
                                                   std::int64_t monotonic_ns,
                                                   std::int64_t wall_ns) {
  // That far back: the daemon's machine restarted behind a program that passes frames on.
  constexpr std::int64_t kOtherBoot = 10'000'000'000;
  if (!epoch_ns_ || monotonic_ns < newest_ns_ - kOtherBoot) {
    epoch_ns_ = wall_ns - monotonic_ns;
    next_picture_ns_ = newest_ns_ = monotonic_ns;
  }
  newest_ns_ = std::max(newest_ns_, monotonic_ns);
  const auto positive = [](std::int64_t ns) {
    return static_cast<std::uint64_t>(std::max<std::int64_t>(0, ns));
  };
  return {positive(*epoch_ns_ + monotonic_ns), positive(wall_ns), sequence};
}

void RecordingWriter::add_message(std::uint16_t channel, const google::protobuf::Message& message) {
  buffer_.clear();
  message.AppendToString(&buffer_);
  writer_.add(mcap::Message{channel, static_cast<std::uint32_t>(now_.sequence), now_.log_time,
                            now_.publish_time, buffer_});
}

void RecordingWriter::add(v1::Frame frame) {
  now_ = moment_of(frame.sequence(), frame.monotonic_ns(), frame.wall_ns());
  if (frame.has_jpeg()) {
    add_jpeg(frame);
    frame.clear_jpeg();
  }
  if (frame.has_depth() && picture_due(frame)) add_picture(frame);
  add_points(frame);
  if (frame.pose().valid()) {
    add_message(pose_, kPoseTopic, pose_in_frame(frame, now_.log_time));
    add_message(transforms_, kTransformsTopic, transforms(frame, now_.log_time));
  }
  if (frame.has_light()) add_light(frame.light());
  add_message(frame_, frame);
}

void RecordingWriter::add_message(std::uint16_t& channel, const char* topic,
                                  const google::protobuf::Message& message) {
  if (channel == 0) channel = add_channel(topic, *message.GetDescriptor());
  add_message(channel, message);
}

bool RecordingWriter::picture_due(const v1::Frame& frame) {
  if (picture_interval_ns_ == 0 || frame.monotonic_ns() < next_picture_ns_) return false;
  // From the time it was due on, so that the mean rate is the one asked for; from now after a gap.
  next_picture_ns_ = std::max(next_picture_ns_, frame.monotonic_ns() - picture_interval_ns_ + 1);
  next_picture_ns_ += picture_interval_ns_;
  return true;
}

/// Points for viewing; none once the contact has ended, since players show the last ones.
void RecordingWriter::add_points(const v1::Frame& frame) {
  const bool ended =
      points_shown_ && !frame.has_cloud() && frame.has_contact() && !frame.contact().in_contact();
  if (!ended && !(frame.has_cloud() && picture_due(frame))) return;
  points_shown_ = frame.has_cloud();
  add_message(points_, kPointsTopic, point_cloud(frame, now_.log_time));
}

void RecordingWriter::add_jpeg(const v1::Frame& frame) {
  add_message(jpeg_, kCameraTopic, jpeg_picture(frame, now_.log_time));
}

void RecordingWriter::add_picture(const v1::Frame& frame) {
  if (picture_ == 0) {
    picture_ = add_channel(kDepthTopic, *foxglove::RawImage::descriptor(),
                           {{"unit", "micrometre"}, {"untrusted", "0"}});
  }
  add_message(picture_, depth_picture(frame, now_.log_time));
}

/// Each light once, from the frame that was exposed under it on.
void RecordingWriter::add_light(const v1::LightState& light) {
  std::string bytes = light.SerializeAsString();
  if (bytes == last_light_) return;
  last_light_ = std::move(bytes);
  add_message(light_, light);
}

void RecordingWriter::add(const v1::Event& event) {
  now_ = moment_of(event.sequence(), event.monotonic_ns(), event.wall_ns());
  add_message(event_, event);
}

void RecordingWriter::add(const v1::Status& status) { add_message(status_, status); }

void RecordingWriter::attach(const std::string& name, const std::string& media_type,
                             const std::string& data) {
  writer_.add(mcap::Attachment{now_.log_time, now_.log_time, name, media_type, data});
}

}  // namespace dtact::recording
