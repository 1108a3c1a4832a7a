#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "clients/common/depth_file.hpp"
#include "clients/geometry/point_cloud.hpp"
#include "daemon/recon/surface.hpp"
#include "proto/dtact.pb.h"

namespace dtact::cli {

/// What a frame says of its surface; of one that says nothing a plane. Throws client::ProtocolError
/// where it contradicts itself or has a shape that this release does not know.
[[nodiscard]] recon::Surface surface_of(const v1::Surface& surface);

/// The reverse, as the daemon says it in a frame.
void set_surface(const recon::Surface& surface, v1::Frame& frame);

/// Like client::values_of(), which checks only the values. Throws client::ProtocolError also where
/// the map's place contradicts itself, and for a scale that no sensor has.
[[nodiscard]] std::vector<std::int16_t> depths_of(const v1::DepthMap& map);
/// The map with these values (depths_of()), which have to outlive it.
[[nodiscard]] perceive::DepthGrid grid_of(const v1::DepthMap& map,
                                          std::span<const std::int16_t> values);

/// The frame's depth map as one to write, with its place and surface. `mm`: its values
/// (client::millimetres_of()), which have to outlive it. Throws as surface_of(), and where the
/// map's place contradicts itself.
[[nodiscard]] DepthImage depth_image(const v1::Frame& frame, std::span<const float> mm);

}  // namespace dtact::cli
