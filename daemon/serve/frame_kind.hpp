#pragma once

#include <cstdint>
#include <optional>

namespace dtact::net {

/// dtact.v1.Region: pixels of the depth map at the calibration's full resolution.
struct DepthRegion {
  std::uint32_t x = 0;
  std::uint32_t y = 0;
  std::uint32_t width = 1;
  std::uint32_t height = 1;
  bool operator==(const DepthRegion&) const = default;
};

/// Which depth map a client asked for, or which part of it the point cloud is of.
struct DepthSpec {
  int decimation = 1;                      ///< 1, 2 or 4: of the calibration's resolution.
  int um_per_unit = 1;                     ///< 1, 2, 5 or 10.
  std::optional<DepthRegion> region = {};  ///< All of the map when unset.
  bool operator==(const DepthSpec&) const = default;
};

/// What a frame message is to hold. Nothing at all: a summary.
struct FrameKind {
  int depth = 0;  ///< dtact.v1.DepthEncoding; 0: none, and the next two say nothing.
  DepthSpec spec = {};
  bool contact_box = false;  ///< The region is where the contact is.
  int luma = 0;              ///< dtact.v1.LumaEncoding
  bool jpeg = false;
  int cloud = 0;  ///< dtact.v1.CloudEncoding; of `spec` and `contact_box`.
  bool pose = false;
  int recognition = 0;  ///< Contacts joined; 0: none.
  bool operator==(const FrameKind&) const = default;
};

}  // namespace dtact::net
