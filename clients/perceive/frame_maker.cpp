#include "clients/perceive/frame_maker.hpp"

#include <algorithm>
#include <chrono>

#include "clients/common/depth_message.hpp"
#include "clients/perceive/cloud_message.hpp"
#include "clients/perceive/pose_message.hpp"
#include "proto/framing.hpp"

namespace dtact::perceive {
namespace {

// Room for an envelope.
constexpr std::size_t kMaxBody = wire::kMaxMessage - 256;
// And for all that a frame holds beside its points.
constexpr std::size_t kMaxCloud = kMaxBody - (std::size_t{64} << 10);

std::size_t bytes_of(const DepthGrid& grid, int stride, int encoding) {
  const std::size_t points =
      std::size_t{static_cast<unsigned>((grid.width + stride - 1) / stride)} *
      static_cast<unsigned>((grid.height + stride - 1) / stride);
  return points * PointCloud::kParts *
         (encoding == v1::CLOUD_FLOAT32 ? sizeof(float) : sizeof(std::int16_t));
}

/// Runs `work` and returns how long it took, nanoseconds.
template <typename Work>
std::uint32_t timed(Work work) {
  const auto began = std::chrono::steady_clock::now();
  work();
  return static_cast<std::uint32_t>(
      std::chrono::nanoseconds(std::chrono::steady_clock::now() - began).count());
}

}  // namespace

void FrameMaker::begin(v1::Frame frame, Wanted wanted) {
  done_.clear();
  depth_.reset();
  pose_.reset();
  frame_ = std::move(frame);
  // Each client has its own count.
  frame_.clear_dropped();
  if (frame_.has_depth()) {
    if (frame_.contact().in_contact()) depth_.emplace(frame_.depth());
    mm_per_px_ = frame_.depth().mm_per_px() / std::max(1U, frame_.depth().decimation());
    follow_sensor();
  }
  const bool gone = frame_.has_contact() && !frame_.contact().in_contact();
  if (gone) release();
  if (!wanted.pose) release_pose();
  if (wanted.pose && depth_) follow(*depth_, frame_.depth().uncertainty_um());
  // A first map may be coarser than the network's cells, and so may those of a coarse resolution.
  const bool fine = frame_.depth().mm_per_px() <= TouchMap::kCellMm;
  if (wanted.recognition && depth_ && depth_->is_whole() && fine) {
    if (!recognition_) recognition_ = std::make_unique<RecognitionThread>(taught_);
    recognition_->offer(depth_->whole(), frame_.sequence());
  }
  frame_.clear_depth();
}

void FrameMaker::follow_sensor() {
  const recon::Surface surface = cli::surface_of(frame_.surface());
  const auto calibration =
      frame_.has_calibration() ? std::optional(frame_.calibration()) : std::nullopt;
  const bool other = std::exchange(calibration_, calibration) != calibration;
  if (surface == clouds_.surface() && !other) return;
  if (surface != clouds_.surface()) clouds_ = CloudMaker(surface);
  release_pose();
  if (recognition_) recognition_->forget();
}

void FrameMaker::release() {
  release_pose();
  if (recognition_) recognition_->release();
}

void FrameMaker::release_pose() {
  tracker_.release();
  if (object_) object_->release();
}

void FrameMaker::follow(DepthCrop& depth, double uncertainty_um) {
  const std::optional<DepthGrid> grid = depth.contact(frame_.contact());
  if (!grid) return;
  const std::uint32_t took = timed([&] {
    clouds_.make(*grid, 1, contact_);
    const ContactView view(*grid, contact_, clouds_.table(), uncertainty_um,
                           clouds_.surface().view);
    if (object_) {
      (void)object_->follow(view, frame_.sequence());
    } else {
      (void)tracker_.follow(view, frame_.sequence());
    }
  });
  const Tracker::Pose& found = object_ ? object_->pose() : tracker_.pose();
  if (found.state == Tracker::State::idle) return;
  v1::ObjectPose& pose = pose_.emplace();
  fill(found, pose);
  if (object_) pose.set_object(object_->object().name);
  pose.set_track_ns(took);
}

void FrameMaker::add_cloud(DepthCrop& depth, const net::FrameKind& kind, v1::PointCloud& out) {
  std::optional<DepthGrid> grid;
  if (kind.contact_box) {
    grid = depth.contact(frame_.contact());
  } else if (depth.is_whole()) {
    grid = kind.spec.region ? depth.cut(*kind.spec.region) : depth.whole();
  }
  if (!grid) return;
  int stride = std::max(1, kind.spec.decimation / depth.decimation());
  while (bytes_of(*grid, stride, kind.cloud) > kMaxCloud) stride *= 2;
  const std::uint32_t took = timed([&] { clouds_.make(*grid, stride, cloud_); });
  fill(cloud_, kind.cloud, out);
  out.set_decimation(static_cast<std::uint32_t>(stride * depth.decimation()));
  out.set_make_ns(took);
}

std::shared_ptr<const net::EncodedFrame> FrameMaker::make(const net::FrameKind& kind) {
  const auto found = std::ranges::find(done_, kind, [](const auto& one) { return one.first; });
  if (found != done_.end()) return found->second;
  v1::Frame message = frame_;
  if (kind.cloud != v1::CLOUD_NONE && depth_) add_cloud(*depth_, kind, *message.mutable_cloud());
  if (message.cloud().points() == 0) message.clear_cloud();
  if (kind.pose && pose_) *message.mutable_pose() = *pose_;
  if (kind.recognition > 0 && recognition_ && frame_.contact().in_contact() &&
      !recognition_->fill(kind.recognition, *message.mutable_recognition())) {
    message.clear_recognition();
  }
  auto encoded = std::make_shared<net::EncodedFrame>();
  if (message.ByteSizeLong() > kMaxBody) {
    encoded.reset();
  } else {
    message.SerializeToString(&encoded->body);
  }
  done_.emplace_back(kind, encoded);
  return encoded;
}

}  // namespace dtact::perceive
