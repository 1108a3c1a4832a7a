#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "daemon/calibration/calibration.hpp"
#include "daemon/pipeline/depth/contact.hpp"
#include "daemon/pipeline/depth/resolutions.hpp"
#include "daemon/pipeline/untouched/calibrated_image.hpp"
#include "daemon/pipeline/untouched/light_follower.hpp"
#include "hal/frame.hpp"
#include "proto/depth_encoding.hpp"
#include "proto/dtact.pb.h"

namespace dtact::reprocess {

/// Whether the frame was recorded under that condition.
[[nodiscard]] bool has(const v1::Frame& frame, v1::Health condition);

/// Makes the depth of recorded frames anew, by the parts that make it in the daemon with its
/// default settings: where the image differs from the untouched one, the light followed, the
/// reconstruction, the contact. Frames come in their order.
class DepthRemaker {
 public:
  /// Throws std::invalid_argument when the calibration covers too little of the frame.
  explicit DepthRemaker(std::shared_ptr<const calibration::Calibration> calibration);

  /// The untouched image from here on, Q8 luma of the frame's size; its light was followed by a
  /// factor already.
  void set_reference(std::span<const std::uint16_t> reference_q8, double light = 1);

  /// Replaces `frame`'s depth, contact and what follows from them. The map has the resolution that
  /// the frame's own had; full resolution where it had none.
  void remake(const hal::LumaView& luma, v1::Frame& frame);

  [[nodiscard]] bool touching() const noexcept { return contact_.touching(); }

 private:
  void follow_light(const pipeline::LightSeen& light, std::int64_t timestamp_ns);
  void describe(const recon::DepthSums& sums, bool beyond, v1::Frame& frame) const;

  std::shared_ptr<const calibration::Calibration> calibration_;
  pipeline::CalibratedImage image_;
  pipeline::Resolutions maps_;
  pipeline::LightFollower follower_;
  pipeline::ContactDetector contact_;
  pipeline::ContactSummary summary_;
  double light_ = 1;  // followed before the recording
  std::vector<std::int16_t> depth_um_;
  recon::DrawnTiles drawn_;
  int drawn_decimation_ = 0;
  wire::PredictZstdEncoder encoder_;
};

}  // namespace dtact::reprocess
