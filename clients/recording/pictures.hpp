#pragma once

#include <google/protobuf/message.h>

#include <cstdint>
#include <string>

#include "clients/recording/foxglove.pb.h"
#include "proto/dtact.pb.h"

// What Foxglove's panels show of a frame: in recordings, and live.
namespace dtact::recording {

/// The schema of a message as Foxglove and MCAP want it: a FileDescriptorSet, serialized, of its
/// file and all that this imports.
[[nodiscard]] std::string schema_of(const google::protobuf::Descriptor& type);

// Of a frame that has the part, at `time_ns` since 1970.

/// Depth as 16UC1: micrometres, 0 where less or not to be believed. Throws client::ProtocolError
/// for a damaged map.
[[nodiscard]] foxglove::RawImage depth_picture(const v1::Frame& frame, std::uint64_t time_ns);
[[nodiscard]] foxglove::CompressedImage jpeg_picture(const v1::Frame& frame, std::uint64_t time_ns);
/// The luma as mono8.
[[nodiscard]] foxglove::RawImage luma_picture(const v1::Frame& frame, std::uint64_t time_ns);

/// The points that are there, metres in the surface frame, with their normals: float32 x, y, z,
/// normal_x, normal_y, normal_z. Of a cloud in CLOUD_FLOAT32; throws client::ProtocolError for any
/// other and for a damaged one.
[[nodiscard]] foxglove::PointCloud point_cloud(const v1::Frame& frame, std::uint64_t time_ns);

}  // namespace dtact::recording
