#include "clients/recording/pictures.hpp"

#include <google/protobuf/descriptor.pb.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
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

template <typename Image>
void stamp(Image& image, std::uint64_t ns, const std::string& frame_id) {
  constexpr std::uint64_t kSecond = 1'000'000'000;
  image.mutable_timestamp()->set_seconds(static_cast<std::int64_t>(ns / kSecond));
  image.mutable_timestamp()->set_nanos(static_cast<std::int32_t>(ns % kSecond));
  image.set_frame_id(frame_id);
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
  if (cloud.encoding() != v1::CLOUD_FLOAT32 || cloud.data().size() % kStride != 0 ||
      cloud.data().size() / kStride != size || cloud.points() > size) {
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
