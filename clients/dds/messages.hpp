#pragma once

#include <dds/dds.h>

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "clients/geometry/point_cloud.hpp"
#include "proto/dtact.pb.h"

// Writes parts of a daemon's frame as ROS 2 messages: metres, newtons, radians; dtact_msgs/msg and
// README.md beside this file explain them. The frame must have the part.
namespace dtact::dds {

/// A ROS 2 header.
struct Header {
  std::int64_t stamp_ns = 0;  ///< ROS time.
  std::string frame_id;
};

/// Indentation of the whole map: metres as 32FC1 with NaN where untrusted, or micrometres as 16UC1
/// with 0 where untrusted or not pressed.
void write_image(dds_entity_t writer, const Header& header, const v1::Frame& frame, bool metres);
/// The map's scale and centre; its projection is parallel.
void write_camera_info(dds_entity_t writer, const Header& header, const v1::DepthMap& map);
void write_jpeg(dds_entity_t writer, const Header& header, const v1::JpegImage& jpeg);

/// Points of the depth map: those in contact, or all. More than fit 200 kB are every second,
/// fourth, … along each side.
class PointWriter {
 public:
  void write(dds_entity_t writer, const Header& header, const v1::Frame& frame, bool all);
  /// A message without points.
  static void write_none(dds_entity_t writer, const Header& header);

 private:
  perceive::CloudMaker maker_;
  perceive::PointCloud cloud_;
};

void write_contact(dds_entity_t writer, const Header& header, const v1::Frame& frame);
/// Nothing where the force is unknown.
void write_wrench(dds_entity_t writer, const Header& header, const v1::Frame& frame);
/// object_pose where the pose is valid.
void write_pose(dds_entity_t writer, const Header& header, const v1::Frame& frame);
void write_tracking(dds_entity_t writer, const Header& header, const v1::ObjectPose& pose);
void write_recognition(dds_entity_t writer, const Header& header,
                       const v1::Recognition& recognition);

/// The mapping from a daemon's CLOCK_MONOTONIC to ROS time.
struct ClockMapping {
  std::int64_t measured_ns = 0;  ///< ROS time.
  std::int64_t offset_ns = 0;
  std::int64_t error_ns = 0;  ///< At most, when it was measured.
  std::int64_t daemon_wall_ahead_ns = 0;
};
void write_clock(dds_entity_t writer, const Header& header, const ClockMapping& mapping,
                 v1::TimestampMeaning meaning);

/// Of the daemon's computer.
void write_temperature(dds_entity_t writer, const Header& header, double celsius);

/// The static transform of each name: from NAME_link, whose x points from the gel to the object and
/// whose z points up, to the surface frame.
void write_transforms(dds_entity_t writer, std::int64_t stamp_ns,
                      const std::vector<std::string>& names);

/// The state of one daemon.
struct Diagnosis {
  enum class Level : std::uint8_t { ok, warning, error };
  Level level = Level::error;
  std::string name;
  std::string message;
  std::string hardware;
  std::vector<std::pair<std::string, std::string>> values;
};
void write_diagnostics(dds_entity_t writer, std::int64_t stamp_ns,
                       const std::vector<Diagnosis>& all);

void write_result(dds_entity_t writer, std::uint64_t id, const std::string& error);

[[nodiscard]] std::string surface_frame(const std::string& name);
[[nodiscard]] std::string camera_frame(const std::string& name);
/// Of the daemon's computer; no transform has it, since nobody knows where it is.
[[nodiscard]] std::string board_frame(const std::string& name);

}  // namespace dtact::dds
