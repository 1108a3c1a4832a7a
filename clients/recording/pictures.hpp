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

}  // namespace dtact::recording
