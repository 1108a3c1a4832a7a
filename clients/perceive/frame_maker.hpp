#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "clients/geometry/point_cloud.hpp"
#include "clients/perceive/depth_crop.hpp"
#include "clients/perceive/pose/object_tracker.hpp"
#include "clients/perceive/pose/tracker.hpp"
#include "clients/perceive/recognition/recognition_thread.hpp"
#include "daemon/serve/encoded_frame.hpp"
#include "daemon/serve/frame_kind.hpp"
#include "proto/dtact.pb.h"

namespace dtact::perceive {

/// Makes the frames for the subscriptions from one frame of the daemon: once for each kind, and
/// only kinds that clients need.
class FrameMaker {
 public:
  /// `object`: the known object to locate; null: track any object in contact. `taught`: folder of
  /// taught objects; empty: none.
  explicit FrameMaker(const std::shared_ptr<const ObjectModel>& object = nullptr,
                      std::filesystem::path taught = {})
      : taught_(std::move(taught)) {
    if (object) object_.emplace(object);
  }
  /// What clients need of a frame beside points.
  struct Wanted {
    bool pose = false;         ///< The object's motion is followed.
    bool recognition = false;  ///< The object is recognised.
  };
  /// Begins another frame. Throws client::ProtocolError for a damaged map.
  void begin(v1::Frame frame, Wanted wanted);
  /// Ends the contact: the next frame begins another one.
  void release();
  /// The frame as `kind`; the same buffer when asked again. Null when it would exceed the wire's
  /// cap.
  [[nodiscard]] std::shared_ptr<const net::EncodedFrame> make(const net::FrameKind& kind);

  [[nodiscard]] const v1::Frame& frame() const noexcept { return frame_; }
  /// Of the daemon's map at full resolution; 0 before one has come.
  [[nodiscard]] double mm_per_px() const noexcept { return mm_per_px_; }
  /// Waits for the recognition of this frame. For runs faster than real time.
  void wait() {
    if (recognition_) recognition_->wait();
  }

 private:
  void add_cloud(DepthCrop& depth, const net::FrameKind& kind, v1::PointCloud& out);
  void release_pose();
  void follow(DepthCrop& depth, double uncertainty_um);
  /// Discards state measured by another calibration or on another surface.
  void follow_sensor();

  double mm_per_px_ = 0;
  v1::Frame frame_;  ///< Without what is made here, and without the depth map.
  std::optional<DepthCrop> depth_;
  std::optional<std::uint64_t> calibration_;  ///< Number of the last depth's.
  CloudMaker clouds_;
  PointCloud cloud_;
  PointCloud contact_;  ///< Its own: what is as it was in cloud_ is not made again.
  Tracker tracker_;
  std::optional<ObjectTracker> object_;  ///< In its place.
  std::optional<v1::ObjectPose> pose_;
  std::filesystem::path taught_;
  std::unique_ptr<RecognitionThread> recognition_;  ///< Since a client first asked.
  std::vector<std::pair<net::FrameKind, std::shared_ptr<const net::EncodedFrame>>> done_;
};

}  // namespace dtact::perceive
