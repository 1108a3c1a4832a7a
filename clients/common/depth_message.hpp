#pragma once

#include <span>

#include "clients/common/depth_file.hpp"
#include "daemon/recon/surface.hpp"
#include "proto/dtact.pb.h"

namespace dtact::cli {

/// What a frame says of its surface; of one that says nothing a plane. Throws client::ProtocolError
/// where it contradicts itself or has a shape that this release does not know.
[[nodiscard]] recon::Surface surface_of(const v1::Surface& surface);

/// The frame's depth map as one to write, with its place and surface. `mm`: its values
/// (client::millimetres_of()), which have to outlive it. Throws as surface_of(), and where the
/// map's place contradicts itself.
[[nodiscard]] DepthImage depth_image(const v1::Frame& frame, std::span<const float> mm);

}  // namespace dtact::cli
