#pragma once

#include <compare>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <vector>

#include "daemon/calibration/calibration.hpp"
#include "daemon/pipeline/depth/contact.hpp"
#include "daemon/pipeline/depth/resolutions.hpp"
#include "daemon/pipeline/reference/calibrated_image.hpp"
#include "daemon/pipeline/reference/light_follower.hpp"
#include "hal/frame.hpp"
#include "proto/depth_encoding.hpp"
#include "proto/dtact.pb.h"

namespace dtact::reprocess {

/// Whether the frame was recorded with that health flag.
[[nodiscard]] bool has(const v1::Frame& frame, v1::Health flag);

/// Recomputes the depth of recorded frames with the daemon's own parts and default settings:
/// difference from the reference, light compensation, reconstruction and contact. Frames must come
/// in their order.
class DepthReprocessor {
 public:
  /// Throws std::invalid_argument when the calibration covers too little of the frame.
  explicit DepthReprocessor(std::shared_ptr<const calibration::Calibration> calibration);

  /// Sets the reference image from here on, Q8 luma of the frame's size; a factor has already
  /// followed its light.
  void set_reference(std::span<const std::uint16_t> reference_q8, double light = 1);

  /// Replaces `frame`'s depth, contact and values computed from them. The map has the resolution
  /// and the sharpening steps of the frame's own; full resolution and no steps without an own map,
  /// and no steps where the calibration has no LUT for them.
  void remake(const hal::LumaView& luma, v1::Frame& frame);

  /// Frames so far whose own map was sharpened by steps that the calibration has no LUT for.
  [[nodiscard]] std::uint64_t unsharpened() const noexcept { return unsharpened_; }

  [[nodiscard]] bool in_contact() const noexcept { return contact_.in_contact(); }

 private:
  /// A map's 1/decimation of the calibration's resolution, and its sharpening steps.
  struct MapVariant {
    int decimation = 1;
    int steps = 0;
    auto operator<=>(const MapVariant&) const = default;
  };

  void follow_light(const pipeline::LightSeen& light, std::int64_t timestamp_ns);
  void set_light(double factor);
  /// The maps of this kind, for the present reference and light.
  [[nodiscard]] pipeline::Resolutions& maps_for(const MapVariant& variant);
  void describe(const recon::DepthSums& sums, const pipeline::Resolutions& maps,
                pipeline::Resolution& resolution, v1::Frame& frame);

  std::shared_ptr<const calibration::Calibration> calibration_;
  pipeline::CalibratedImage image_;
  std::vector<int> steps_;  ///< Steps with a LUT in the calibration.
  std::map<MapVariant, pipeline::Resolutions> maps_;
  std::vector<std::uint16_t> reference_q8_;
  pipeline::LightFollower follower_;
  pipeline::ContactDetector contact_;
  pipeline::ContactSummary summary_;
  double light_ = 1;      // factor of the light before the recording
  double light_now_ = 1;  // and since then
  std::vector<std::int16_t> depth_um_;
  recon::DrawnTiles drawn_;
  MapVariant drawn_variant_;
  std::uint64_t unsharpened_ = 0;
  wire::PredictZstdEncoder encoder_;
};

}  // namespace dtact::reprocess
