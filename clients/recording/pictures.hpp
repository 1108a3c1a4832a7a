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

// The frame must have the part. `time_ns`: nanoseconds since 1970.

/// Depth as 16UC1: micrometres, 0 where not pressed or untrusted. Throws client::ProtocolError
/// for a damaged map.
[[nodiscard]] foxglove::RawImage depth_picture(const v1::Frame& frame, std::uint64_t time_ns);
[[nodiscard]] foxglove::CompressedImage jpeg_picture(const v1::Frame& frame, std::uint64_t time_ns);
/// The luma as mono8.
[[nodiscard]] foxglove::RawImage luma_picture(const v1::Frame& frame, std::uint64_t time_ns);

/// The object's pose in the surface frame. `pose` of the frame must be valid.
[[nodiscard]] foxglove::PoseInFrame pose_in_frame(const v1::Frame& frame, std::uint64_t time_ns);
/// The same as the transform of a frame of the object, named after the surface's with "_object".
[[nodiscard]] foxglove::FrameTransforms transforms(const v1::Frame& frame, std::uint64_t time_ns);

/// The valid points in the surface frame, metres, with their normals: float32 x, y, z, normal_x,
/// normal_y, normal_z. Without a cloud, no points. The cloud must be CLOUD_FLOAT32; throws
/// client::ProtocolError for any other and for a damaged one.
[[nodiscard]] foxglove::PointCloud point_cloud(const v1::Frame& frame, std::uint64_t time_ns);

}  // namespace dtact::recording
