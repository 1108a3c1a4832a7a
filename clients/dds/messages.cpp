#include "clients/dds/messages.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <iterator>
#include <limits>
#include <span>
#include <string_view>

#include "clients/common/depth_message.hpp"
#include "clients/cpp/maps.hpp"
#include "clients/cpp/names.hpp"
#include "clients/dds/ros2.h"
#include "clients/geometry/surface_table.hpp"
#include "clients/recording/pictures.hpp"

namespace dtact::dds {
namespace {

static_assert(std::endian::native == std::endian::little);

constexpr double kMetres = 1e-3;           ///< A millimetre.
constexpr std::size_t kMaxCloud = 200000;  ///< Bytes that default socket buffers take.
constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

// The messages' C types are made for receiving, too, and so have no const. Writing changes nothing.
char* text(const std::string& value) { return const_cast<char*>(value.c_str()); }
char* text(const char* value) { return const_cast<char*>(value); }

/// Makes a sequence of a message refer to `values`, which must outlive it.
template <typename Sequence, typename Value>
void refer(Sequence& sequence, const Value* values, std::size_t count) {
  sequence._length = sequence._maximum = static_cast<std::uint32_t>(count);
  sequence._buffer = const_cast<decltype(sequence._buffer)>(values);
}
template <typename Sequence, typename Values>
void refer(Sequence& sequence, const Values& values) {
  refer(sequence, std::data(values), std::size(values));
}

builtin_interfaces_msg_dds__Time_ time_of(std::int64_t ns) {
  constexpr std::int64_t kSecond = 1'000'000'000;
  return {static_cast<std::int32_t>(ns / kSecond), static_cast<std::uint32_t>(ns % kSecond)};
}

std_msgs_msg_dds__Header_ made(const Header& header) {
  return {time_of(header.stamp_ns), text(header.frame_id)};
}

/// A failure is that of a peer that does not read; the next message is another chance.
template <typename Message>
void write(dds_entity_t writer, const Message& message) {
  (void)dds_write(writer, &message);
}

geometry_msgs_msg_dds__Point_ point(double x_mm, double y_mm) {
  return {kMetres * x_mm, kMetres * y_mm, 0};
}

std::string lower_name(const std::string& name, std::size_t prefix) {
  std::string made = name.substr(std::min(prefix, name.size()));
  std::ranges::transform(made, made.begin(), [](unsigned char c) { return std::tolower(c); });
  return made;
}

}  // namespace

std::string surface_frame(const std::string& name) { return name + "_surface_optical"; }
std::string camera_frame(const std::string& name) { return name + "_camera_optical"; }
std::string board_frame(const std::string& name) { return name + "_board"; }

void write_image(dds_entity_t writer, const Header& header, const v1::Frame& frame, bool metres) {
  const v1::DepthMap& map = frame.depth();
  sensor_msgs_msg_dds__Image_ image{};
  image.header = made(header);
  image.width = map.width();
  image.height = map.height();
  if (metres) {
    std::vector<float> values = client::millimetres_of(map);
    for (float& value : values) value *= static_cast<float>(kMetres);
    image.encoding = text("32FC1");
    image.step = 4 * map.width();
    refer(image.data, reinterpret_cast<const std::uint8_t*>(values.data()), 4 * values.size());
    return write(writer, image);
  }
  const foxglove::RawImage picture = recording::depth_picture(frame, 0);
  image.encoding = text(picture.encoding());
  image.step = picture.step();
  refer(image.data, reinterpret_cast<const std::uint8_t*>(picture.data().data()),
        picture.data().size());
  write(writer, image);
}

void write_camera_info(dds_entity_t writer, const Header& header, const v1::DepthMap& map) {
  const double scale = 1 / (kMetres * map.mm_per_px());
  const double x = 0.5 * (map.width() - 1.0);
  const double y = 0.5 * (map.height() - 1.0);
  const std::array<double, 9> k{scale, 0, x, 0, scale, y, 0, 0, 1};
  const std::array<double, 9> r{1, 0, 0, 0, 1, 0, 0, 0, 1};
  // Pixel = scale · position + centre, whatever z is.
  const std::array<double, 12> p{scale, 0, 0, x, 0, scale, 0, y, 0, 0, 0, 1};
  sensor_msgs_msg_dds__CameraInfo_ info{};
  info.header = made(header);
  info.width = map.width();
  info.height = map.height();
  info.distortion_model = text("");
  std::ranges::copy(k, std::begin(info.k));
  std::ranges::copy(r, std::begin(info.r));
  std::ranges::copy(p, std::begin(info.p));
  write(writer, info);
}

void write_jpeg(dds_entity_t writer, const Header& header, const v1::JpegImage& jpeg) {
  sensor_msgs_msg_dds__CompressedImage_ image{};
  image.header = made(header);
  image.format = text("jpeg");
  refer(image.data, reinterpret_cast<const std::uint8_t*>(jpeg.data().data()), jpeg.data().size());
  write(writer, image);
}

namespace {

constexpr std::array<const char*, 7> kPointFields{"x",        "y",        "z",          "normal_x",
                                                  "normal_y", "normal_z", "indentation"};
constexpr std::size_t kPointBytes = kPointFields.size() * sizeof(float);

void write_points(dds_entity_t writer, const Header& header, const std::vector<float>& values) {
  std::array<sensor_msgs_msg_dds__PointField_, kPointFields.size()> fields{};
  for (std::size_t i = 0; i < fields.size(); ++i) {
    constexpr std::uint8_t kFloat32 = 7;
    fields[i] = {text(kPointFields[i]), static_cast<std::uint32_t>(i * sizeof(float)), kFloat32, 1};
  }
  sensor_msgs_msg_dds__PointCloud2_ cloud{};
  cloud.header = made(header);
  cloud.height = 1;
  cloud.width = static_cast<std::uint32_t>(values.size() / kPointFields.size());
  refer(cloud.fields, fields);
  cloud.point_step = kPointBytes;
  cloud.row_step = cloud.point_step * cloud.width;
  refer(cloud.data, reinterpret_cast<const std::uint8_t*>(values.data()),
        values.size() * sizeof(float));
  cloud.is_dense = true;
  write(writer, cloud);
}

}  // namespace

void PointWriter::write_none(dds_entity_t writer, const Header& header) {
  write_points(writer, header, {});
}

void PointWriter::write(dds_entity_t writer, const Header& header, const v1::Frame& frame,
                        bool all) {
  const v1::DepthMap& map = frame.depth();
  const recon::Surface surface = cli::surface_of(frame.surface());
  if (surface != maker_.surface()) maker_ = perceive::CloudMaker(surface);
  const std::vector<std::int16_t> depths = cli::depths_of(map);
  const perceive::DepthGrid grid = cli::grid_of(map, depths);
  const double min_mm = frame.contact().threshold_mm();
  if (!all && !frame.contact().in_contact()) return write_none(writer, header);
  const auto millimetres = [&](std::int16_t depth) { return 1e-3 * map.um_per_unit() * depth; };
  const auto points = std::ranges::count_if(depths, [&](std::int16_t depth) {
    return depth != map.untrusted_value() && (all || millimetres(depth) >= min_mm);
  });
  // A cloud is made as a whole for any stride: not those that would be too large anyway.
  int stride = 1;
  while (static_cast<std::size_t>(points) * kPointBytes >
         kMaxCloud * static_cast<std::size_t>(stride) * static_cast<std::size_t>(stride)) {
    stride *= 2;
  }
  std::vector<float> values;
  for (;; stride *= 2) {
    values.clear();
    maker_.make(grid, stride, cloud_);
    for (std::size_t i = 0; i < cloud_.size(); ++i) {
      if (!cloud_.has(i)) continue;
      const auto column =
          cloud_.x + static_cast<int>(i % static_cast<std::size_t>(cloud_.width)) * cloud_.stride -
          grid.x;
      const auto row =
          cloud_.y + static_cast<int>(i / static_cast<std::size_t>(cloud_.width)) * cloud_.stride -
          grid.y;
      const auto at = static_cast<std::size_t>(row) * static_cast<std::size_t>(grid.width) +
                      static_cast<std::size_t>(column);
      const double mm = millimetres(depths[at]);
      if (!all && mm < min_mm) continue;
      for (std::size_t part = 0; part < perceive::PointCloud::kParts; ++part) {
        values.push_back(cloud_.values[part * cloud_.size() + i]);
      }
      values.push_back(static_cast<float>(kMetres * mm));
    }
    if (values.size() * sizeof(float) <= kMaxCloud) break;
  }
  write_points(writer, header, values);
}

void write_contact(dds_entity_t writer, const Header& header, const v1::Frame& frame) {
  const v1::Contact& contact = frame.contact();
  const std::vector<std::string> flags = client::names_of(frame.health());
  std::vector<char*> health;
  health.reserve(flags.size());
  for (const std::string& flag : flags) health.push_back(text(flag));
  const std::string absence = frame.has_contact()
                                  ? ""
                                  : lower_name(v1::ContactAbsence_Name(frame.contact_absence()),
                                               std::string_view("CONTACT_ABSENCE_").size());
  const std::string force_absence =
      contact.has_force_n() || !frame.has_contact() ? "" : client::name_of(contact.force_absence());
  dtact_msgs_msg_dds__Contact_ message{};
  message.header = made(header);
  message.frame_number = frame.sequence();
  message.dropped = frame.dropped();
  refer(message.health, health);
  message.measured = frame.has_contact();
  message.absence = text(absence);
  message.in_contact = contact.in_contact();
  message.area = kMetres * kMetres * contact.area_mm2();
  message.centroid = point(contact.x_mm(), contact.y_mm());
  message.indentation = kMetres * contact.deepest_mm();
  message.deepest_at = point(contact.deepest_x_mm(), contact.deepest_y_mm());
  message.volume = kMetres * kMetres * kMetres * contact.volume_mm3();
  message.threshold = kMetres * contact.threshold_mm();
  message.uncertainty = frame.has_depth() ? 1e-6 * frame.depth().uncertainty_um() : kUnknown;
  message.force = contact.has_force_n() ? contact.force_n() : kUnknown;
  message.force_uncertainty =
      contact.has_force_uncertainty_n() ? contact.force_uncertainty_n() : kUnknown;
  message.force_absence = text(force_absence);
  write(writer, message);
}

void write_wrench(dds_entity_t writer, const Header& header, const v1::Frame& frame) {
  const v1::Contact& contact = frame.contact();
  if (!contact.has_force_n()) return;
  // The object presses against the surface, at the contact's centre.
  const auto at =
      perceive::cast_ray(cli::surface_of(frame.surface()), contact.x_mm(), contact.y_mm());
  if (!at) return;
  const perceive::Vector& p = at->point;
  const perceive::Vector& n = at->normal;
  const std::array<double, 3> f{-contact.force_n() * n[0], -contact.force_n() * n[1],
                                -contact.force_n() * n[2]};
  geometry_msgs_msg_dds__WrenchStamped_ message{};
  message.header = made(header);
  message.wrench.force = {f[0], f[1], f[2]};
  message.wrench.torque = {p[1] * f[2] - p[2] * f[1], p[2] * f[0] - p[0] * f[2],
                           p[0] * f[1] - p[1] * f[0]};
  write(writer, message);
}

void write_pose(dds_entity_t writer, const Header& header, const v1::Frame& frame) {
  const foxglove::PoseInFrame pose = recording::pose_in_frame(frame, 0);
  const auto& position = pose.pose().position();
  const auto& turn = pose.pose().orientation();
  geometry_msgs_msg_dds__PoseStamped_ message{};
  message.header = made(header);
  message.pose.position = {position.x(), position.y(), position.z()};
  message.pose.orientation = {turn.x(), turn.y(), turn.z(), turn.w()};
  write(writer, message);
}

void write_tracking(dds_entity_t writer, const Header& header, const v1::ObjectPose& pose) {
  const std::string tracking = lower_name(v1::ObjectPose::Tracking_Name(pose.tracking()), 0);
  dtact_msgs_msg_dds__ObjectTracking_ message{};
  message.header = made(header);
  message.valid = pose.valid();
  message.tracking = text(tracking);
  message.object_name = text(pose.object());
  message.since_sequence = pose.since_sequence();
  message.alternatives = pose.alternatives();
  message.unobservable = static_cast<std::uint32_t>(pose.unobservable_size());
  message.residual = 1e-6 * pose.residual_um();
  write(writer, message);
}

void write_recognition(dds_entity_t writer, const Header& header,
                       const v1::Recognition& recognition) {
  const std::string verdict = lower_name(v1::Recognition::Verdict_Name(recognition.verdict()), 0);
  std::vector<char*> candidates;
  std::vector<double> probabilities;
  for (const v1::Recognition::Candidate& one : recognition.candidates()) {
    candidates.push_back(text(one.name()));
    probabilities.push_back(one.probability());
  }
  dtact_msgs_msg_dds__Recognition_ message{};
  message.header = made(header);
  message.verdict = text(verdict);
  refer(message.candidates, candidates);
  refer(message.probabilities, probabilities);
  message.score = recognition.score();
  message.presses = recognition.presses();
  write(writer, message);
}

void write_clock(dds_entity_t writer, const Header& header, const ClockMapping& mapping,
                 v1::TimestampMeaning meaning) {
  const std::string moment = meaning == v1::TIMESTAMP_UNSPECIFIED ? "" : client::name_of(meaning);
  dtact_msgs_msg_dds__ClockMapping_ message{};
  message.header = made(header);
  message.offset_ns = mapping.offset_ns;
  message.error_ns = mapping.error_ns;
  message.daemon_wall_ahead_ns = mapping.daemon_wall_ahead_ns;
  message.stamp_meaning = text(moment);
  write(writer, message);
}

void write_temperature(dds_entity_t writer, const Header& header, double celsius) {
  sensor_msgs_msg_dds__Temperature_ message{};
  message.header = made(header);
  message.temperature = celsius;
  write(writer, message);
}

void write_transforms(dds_entity_t writer, std::int64_t stamp_ns,
                      const std::vector<std::string>& names) {
  std::vector<std::pair<std::string, std::string>> frames;
  frames.reserve(names.size());
  std::vector<geometry_msgs_msg_dds__TransformStamped_> transforms;
  for (const std::string& name : names) {
    const auto& [link, surface] = frames.emplace_back(name + "_link", surface_frame(name));
    geometry_msgs_msg_dds__TransformStamped_& one = transforms.emplace_back();
    one.header = {time_of(stamp_ns), text(link)};
    one.child_frame_id = text(surface);
    one.transform.rotation = {-0.5, 0.5, -0.5, 0.5};
  }
  tf2_msgs_msg_dds__TFMessage_ message{};
  refer(message.transforms, transforms);
  write(writer, message);
}

void write_diagnostics(dds_entity_t writer, std::int64_t stamp_ns,
                       const std::vector<Diagnosis>& all) {
  std::vector<std::vector<diagnostic_msgs_msg_dds__KeyValue_>> values;
  std::vector<diagnostic_msgs_msg_dds__DiagnosticStatus_> statuses;
  for (const Diagnosis& one : all) {
    auto& pairs = values.emplace_back();
    for (const auto& [key, value] : one.values) pairs.push_back({text(key), text(value)});
    diagnostic_msgs_msg_dds__DiagnosticStatus_& status = statuses.emplace_back();
    status.level = static_cast<std::uint8_t>(one.level);
    status.name = text(one.name);
    status.message = text(one.message);
    status.hardware_id = text(one.hardware);
    refer(status.values, pairs);
  }
  const Header header{stamp_ns, ""};
  diagnostic_msgs_msg_dds__DiagnosticArray_ message{};
  message.header = made(header);
  refer(message.status, statuses);
  write(writer, message);
}

void write_result(dds_entity_t writer, std::uint64_t id, const std::string& error) {
  write(writer, dtact_msgs_msg_dds__Result_{id, error.empty(), text(error)});
}

}  // namespace dtact::dds
