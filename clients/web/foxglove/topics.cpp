#include "clients/web/foxglove/topics.hpp"

#include <algorithm>

#include "clients/recording/channels.hpp"
#include "clients/recording/pictures.hpp"

namespace dtact::web::foxglove {
namespace {

std::uint64_t time_of(const v1::Frame& frame) {
  return static_cast<std::uint64_t>(std::max<std::int64_t>(0, frame.wall_ns()));
}

std::shared_ptr<const Message> made(const v1::Frame& frame,
                                    const google::protobuf::Message& message) {
  return std::make_shared<const Message>(Message{time_of(frame), message.SerializeAsString()});
}

/// Like in a recording: images have channels of their own.
std::shared_ptr<const Message> without_pictures(const v1::Frame& frame, bool depth) {
  v1::Frame plain = frame;
  plain.clear_luma();
  plain.clear_jpeg();
  plain.clear_cloud();
  if (!depth) plain.clear_depth();
  return made(frame, plain);
}

}  // namespace

std::shared_ptr<const Message> points_of(const v1::Frame& frame) {
  return made(frame, recording::point_cloud(frame, time_of(frame)));
}

const std::array<TopicInfo, kTopics>& topics() {
  static const std::array<TopicInfo, kTopics> all{{
      {Topic::frame, recording::kFrameTopic, v1::Frame::descriptor()},
      {Topic::summary, "/dtact/summary", v1::Frame::descriptor()},
      {Topic::contact, "/dtact/contact", v1::Contact::descriptor()},
      {Topic::light, recording::kLightTopic, v1::LightState::descriptor()},
      {Topic::event, recording::kEventTopic, v1::Event::descriptor()},
      {Topic::depth, recording::kDepthTopic, ::foxglove::RawImage::descriptor()},
      {Topic::luma, "/camera/luma", ::foxglove::RawImage::descriptor()},
      {Topic::jpeg, recording::kCameraTopic, ::foxglove::CompressedImage::descriptor()},
      {Topic::points, recording::kPointsTopic, ::foxglove::PointCloud::descriptor()},
      {Topic::pose, recording::kPoseTopic, ::foxglove::PoseInFrame::descriptor()},
      {Topic::recognition, recording::kRecognitionTopic, v1::Recognition::descriptor()},
      {Topic::transforms, recording::kTransformsTopic, ::foxglove::FrameTransforms::descriptor()},
  }};
  return all;
}

Topics served_by(const std::optional<v1::HelloReply>& daemon) {
  Topics served;
  if (daemon && std::ranges::count(daemon->features(), "cloud") > 0) {
    for (const Topic topic : {Topic::summary, Topic::contact, Topic::points, Topic::pose,
                              Topic::recognition, Topic::transforms}) {
      served.set(index(topic));
    }
    return served;
  }
  served.set();
  for (const Topic topic : {Topic::points, Topic::pose, Topic::recognition, Topic::transforms}) {
    served.reset(index(topic));
  }
  return served;
}

v1::Subscribe subscription_for(Topics wanted) {
  const auto wants = [wanted](Topic topic) { return wanted.test(index(topic)); };
  v1::Subscribe request;
  // Clients of whole frames store them or are remote; images are made here.
  if (wants(Topic::frame)) {
    request.set_depth(v1::DEPTH_PREDICT_ZSTD);
  } else if (wants(Topic::depth)) {
    request.set_depth(v1::DEPTH_INT16);
  }
  if (request.depth() != v1::DEPTH_NONE) request.set_depth_hz(kMaxHz);
  if (wants(Topic::luma)) {
    request.set_luma(v1::LUMA_GREY8);
    request.set_luma_hz(kMaxHz);
  }
  if (wants(Topic::jpeg)) {
    request.set_jpeg(true);
    request.set_jpeg_hz(kMaxHz);
  }
  if (wants(Topic::points)) {
    request.set_cloud(v1::CLOUD_FLOAT32);
    request.set_cloud_hz(kMaxHz);
    request.set_contact_box(true);
    request.set_decimation(2);
  }
  if (wants(Topic::pose) || wants(Topic::transforms)) {
    request.set_pose(true);
    request.set_pose_hz(kMaxHz);
  }
  if (wants(Topic::recognition)) {
    request.set_recognition(true);
    request.set_recognition_hz(kMaxHz);
  }
  // Points also with the frame in which the contact has ended.
  if (wants(Topic::points) || wants(Topic::frame) || wants(Topic::summary) ||
      wants(Topic::contact) || wants(Topic::light)) {
    request.set_summary(true);
    request.set_summary_hz(kMaxHz);
  }
  return request;
}

std::shared_ptr<const Message> message_of(Topic topic, const v1::Frame& frame) {
  const auto time_ns = time_of(frame);
  switch (topic) {
    case Topic::frame:
      return without_pictures(frame, true);
    case Topic::summary:
      return without_pictures(frame, false);
    case Topic::contact:
      return frame.has_contact() ? made(frame, frame.contact()) : nullptr;
    case Topic::depth:
      return frame.has_depth() ? made(frame, recording::depth_picture(frame, time_ns)) : nullptr;
    case Topic::luma:
      return frame.has_luma() ? made(frame, recording::luma_picture(frame, time_ns)) : nullptr;
    case Topic::jpeg:
      return frame.has_jpeg() ? made(frame, recording::jpeg_picture(frame, time_ns)) : nullptr;
    case Topic::points:
      return frame.has_cloud() ? points_of(frame) : nullptr;
    case Topic::pose:
      return frame.pose().valid() ? made(frame, recording::pose_in_frame(frame, time_ns)) : nullptr;
    case Topic::recognition:
      return frame.has_recognition() ? made(frame, frame.recognition()) : nullptr;
    case Topic::transforms:
      return frame.pose().valid() ? made(frame, recording::transforms(frame, time_ns)) : nullptr;
    case Topic::light:
      return frame.has_light() ? made(frame, frame.light()) : nullptr;
    case Topic::event:
      return nullptr;
  }
  return nullptr;
}

}  // namespace dtact::web::foxglove
