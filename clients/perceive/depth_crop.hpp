#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "clients/geometry/point_cloud.hpp"
#include "daemon/serve/frame_kind.hpp"

namespace dtact::v1 {
class Contact;
class DepthMap;
}  // namespace dtact::v1

namespace dtact::perceive {

/// The depth map of a frame and the parts of it that clients ask for.
class DepthCrop {
 public:
  /// Throws client::ProtocolError for a damaged map.
  explicit DepthCrop(const v1::DepthMap& map);

  [[nodiscard]] const DepthGrid& whole() const noexcept { return whole_; }
  /// The daemon sent all of the map.
  [[nodiscard]] bool is_whole() const noexcept {
    return whole_.width == whole_.full_width && whole_.height == whole_.full_height;
  }
  [[nodiscard]] int decimation() const noexcept { return decimation_; }

  /// The pixels of a region, grown outward to whole pixels of the map; nothing when the region lies
  /// beside it. The values are valid until the next call.
  [[nodiscard]] std::optional<DepthGrid> cut(const net::DepthRegion& region);
  /// The same of the box around what is pressed deeper than the contact threshold, or than half of
  /// the deepest where that is less, kMarginPx around it.
  [[nodiscard]] std::optional<DepthGrid> contact(const v1::Contact& contact);

  static constexpr int kMarginPx =
      16;  ///< Same as the daemon's, pixels of the calibration's resolution.

 private:
  [[nodiscard]] std::optional<DepthGrid> crop(int left, int top, int right, int bottom);

  std::vector<std::int16_t> values_;
  std::vector<std::int16_t> cut_;
  DepthGrid whole_;
  int decimation_ = 1;
};

}  // namespace dtact::perceive
