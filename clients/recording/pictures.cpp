#include "clients/recording/pictures.hpp"

#include <google/protobuf/descriptor.pb.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numbers>
#include <set>
#include <vector>

#include "clients/cpp/errors.hpp"
#include "clients/cpp/maps.hpp"

namespace dtact::recording {
namespace {

/// Frame id of the camera image.
constexpr const char* kCameraFrame = "dtact_camera";

constexpr std::array<const char*, 6> kPointParts{"x", "y", "z", "normal_x", "normal_y", "normal_z"};
static_assert(std::endian::native == std::endian::little);

/// A file and all that it imports, those first, as protoc --include_imports writes them.
void add_files(const google::protobuf::FileDescriptor& file,
               std::set<const google::protobuf::FileDescriptor*>& known,
               google::protobuf::FileDescriptorSet& set) {
  if (!known.insert(&file).second) return;
  for (int i = 0; i < file.dependency_count(); ++i) add_files(*file.dependency(i), known, set);
  file.CopyTo(set.add_file());
}

template <typename Message>
void stamp(Message& message, std::uint64_t ns) {
  constexpr std::uint64_t kSecond = 1'000'000'000;
  message.mutable_timestamp()->set_seconds(static_cast<std::int64_t>(ns / kSecond));
  message.mutable_timestamp()->set_nanos(static_cast<std::int32_t>(ns % kSecond));
}

template <typename Message>
void stamp(Message& message, std::uint64_t ns, const std::string& frame_id) {
  stamp(message, ns);
  message.set_frame_id(frame_id);
}

/// The position and orientation of the object: metres, and a unit quaternion.
void fill(const v1::ObjectPose& pose, foxglove::Vector3& position, foxglove::Quaternion& turn) {
  position.set_x(1e-3 * pose.translation_mm().x());
  position.set_y(1e-3 * pose.translation_mm().y());
  position.set_z(1e-3 * pose.translation_mm().z());
  const v1::Vector3& axis = pose.rotation_deg();
  const double degrees = std::hypot(axis.x(), axis.y(), axis.z());
  const double half = 0.5 * degrees * std::numbers::pi / 180;
  const double scale = degrees > 0 ? std::sin(half) / degrees : 0;
  turn.set_x(scale * axis.x());
  turn.set_y(scale * axis.y());
  turn.set_z(scale * axis.z());
  turn.set_w(std::cos(half));
}

/// Micrometres, 0 where less or not to be believed.
std::string pixels_of(const v1::DepthMap& map) {
  const std::vector<std::int16_t> values = client::values_of(map);
  std::string data;
  data.reserve(2 * values.size());
  for (const std::int16_t value : values) {
    const double um = value == map.untrusted_value() ? 0 : value * map.um_per_unit();
    const auto pixel = static_cast<std::uint16_t>(um > 0 ? std::min(um + 0.5, 65535.0) : 0);
    data += static_cast<char>(pixel % 256);
    data += static_cast<char>(pixel / 256);
  }
  return data;
}

}  // namespace

std::string schema_of(const google::protobuf::Descriptor& type) {
  google::protobuf::FileDescriptorSet files;
  std::set<const google::protobuf::FileDescriptor*> known;
  add_files(*type.file(), known, files);
  return files.SerializeAsString();
}

foxglove::RawImage depth_picture(const v1::Frame& frame, std::uint64_t time_ns) {
  const v1::DepthMap& map = frame.depth();
  foxglove::RawImage image;
  stamp(image, time_ns, frame.frame_id());
  image.set_width(map.width());
  image.set_height(map.height());
  image.set_encoding("16UC1");
  image.set_step(2 * map.width());
  image.set_data(pixels_of(map));
  return image;
}

foxglove::CompressedImage jpeg_picture(const v1::Frame& frame, std::uint64_t time_ns) {
  foxglove::CompressedImage image;
  stamp(image, time_ns, kCameraFrame);
  image.set_format("jpeg");
  image.set_data(frame.jpeg().data());
  return image;
}

foxglove::PointCloud point_cloud(const v1::Frame& frame, std::uint64_t time_ns) {
  const v1::PointCloud& cloud = frame.cloud();
  constexpr std::size_t kStride = kPointParts.size() * sizeof(float);
  const std::size_t size = std::size_t{cloud.width()} * cloud.height();
  // Divided, as the product of what the daemon says may not fit 64 bits.
  const bool known = !frame.has_cloud() || cloud.encoding() == v1::CLOUD_FLOAT32;
  if (!known || cloud.data().size() % kStride != 0 || cloud.data().size() / kStride != size ||
      cloud.points() > size) {
    throw client::ProtocolError("a cloud of points is damaged: update dtact-perceive or dtact-web");
  }
  foxglove::PointCloud out;
  stamp(out, time_ns, frame.frame_id());
  out.mutable_pose()->mutable_orientation()->set_w(1);
  out.set_point_stride(kStride);
  for (std::size_t part = 0; part < kPointParts.size(); ++part) {
    foxglove::PackedElementField& field = *out.add_fields();
    field.set_name(kPointParts[part]);
    field.set_offset(static_cast<std::uint32_t>(part * sizeof(float)));
    field.set_type(foxglove::PackedElementField::FLOAT32);
  }
  // The wire has one array after the other; Foxglove wants one point after the other.
  std::vector<float> values(kPointParts.size() * size);
  cloud.data().copy(reinterpret_cast<char*>(values.data()), cloud.data().size());
  std::string& data = *out.mutable_data();
  data.reserve(cloud.points() * kStride);
  for (std::size_t i = 0; i < size; ++i) {
    if (std::isnan(values[i])) continue;
    for (std::size_t part = 0; part < kPointParts.size(); ++part) {
      const float value = values[part * size + i];
      data.append(reinterpret_cast<const char*>(&value), sizeof value);
    }
  }
  return out;
}

foxglove::PoseInFrame pose_in_frame(const v1::Frame& frame, std::uint64_t time_ns) {
  foxglove::PoseInFrame out;
  stamp(out, time_ns, frame.frame_id());
  fill(frame.pose(), *out.mutable_pose()->mutable_position(),
       *out.mutable_pose()->mutable_orientation());
  return out;
}

foxglove::FrameTransforms transforms(const v1::Frame& frame, std::uint64_t time_ns) {
  foxglove::FrameTransforms out;
  foxglove::FrameTransform& one = *out.add_transforms();
  stamp(one, time_ns);
  one.set_parent_frame_id(frame.frame_id());
  one.set_child_frame_id(frame.frame_id() + "_object");
  fill(frame.pose(), *one.mutable_translation(), *one.mutable_rotation());
  return out;
}

foxglove::RawImage luma_picture(const v1::Frame& frame, std::uint64_t time_ns) {
  const v1::LumaMap& map = frame.luma();
  foxglove::RawImage image;
  stamp(image, time_ns, kCameraFrame);
  image.set_width(map.width());
  image.set_height(map.height());
  image.set_encoding("mono8");
  image.set_step(map.width());
  image.set_data(map.data());
  return image;
}

}  // namespace dtact::recording
