#include "clients/perceive/pose/tracker.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace dtact::perceive {
namespace {

/// Surfels of a keyframe.
constexpr std::size_t kSurfels = 600;
/// A contact that has grown so many times shows what its keyframe lacks.
constexpr std::size_t kGrown = 2;
/// What a good alignment has at least, beside kGoodRms.
constexpr double kGoodOverlap = 0.4;
/// Sharing less with every keyframe, a frame becomes one.
constexpr double kSharedOverlap = 0.7;
constexpr std::size_t kMostKeyframes = 16;
/// More than this in one frame is not followed but searched for: metres, radians.
constexpr double kMostSlide = 1e-3;
constexpr double kMostTurn = 0.25;

bool is_good(const Alignment& alignment) {
  return alignment.overlap >= kGoodOverlap && alignment.rms <= kGoodRms;
}

}  // namespace

bool is_near(const Motion& a, const Motion& b, const Eigen::Vector3d& at) {
  const Motion back = a * b.inverse();
  return (back * at - at).norm() <= kMostSlide &&
         Eigen::AngleAxisd(back.rotation).angle() <= kMostTurn;
}

void Tracker::release() {
  keyframes_.clear();
  pose_ = {};
}

Tracker::Keyframe Tracker::keyframe_of(const ContactView& view) const {
  Keyframe key;
  key.motion = pose_.alignment.motion;
  key.pixels = view.pixels();
  key.centre = view.centre();
  key.surfels = view.choose(kSurfels);
  const Eigen::Matrix3d back = key.motion.rotation.transpose();
  for (Surfel& surfel : key.surfels) {
    surfel.point = back * (surfel.point - key.motion.translation);
    surfel.normal = back * surfel.normal;
  }
  return key;
}

void Tracker::add_keyframe(const ContactView& view) {
  // The first stays: what is nearest to the beginning has the least error.
  if (keyframes_.size() == kMostKeyframes) keyframes_.erase(keyframes_.begin() + 1);
  keyframes_.push_back(keyframe_of(view));
  current_ = keyframes_.size() - 1;
}

/// By the present keyframe, or by an older one that shares as much.
Alignment Tracker::best(const ContactView& view, const Motion& from) {
  Alignment found = align(keyframes_[current_].surfels, view, from);
  if (is_good(found) && found.overlap >= kSharedOverlap && current_ == 0) return found;
  // Those that lay nearest to where the contact is in the object.
  const Eigen::Vector3d here = from.rotation.transpose() * (view.centre() - from.translation);
  std::size_t nearest = current_;
  double least = INFINITY;
  for (std::size_t i = 0; i < keyframes_.size(); ++i) {
    const Motion& motion = keyframes_[i].motion;
    const Eigen::Vector3d there =
        motion.rotation.transpose() * (keyframes_[i].centre - motion.translation);
    const double turn = Eigen::AngleAxisd(motion.rotation.transpose() * from.rotation).angle();
    const double distance = (there - here).norm() + 1e-3 * turn;
    if (distance < least) {
      least = distance;
      nearest = i;
    }
  }
  if (nearest == current_) return found;
  Alignment other = align(keyframes_[nearest].surfels, view, from);
  const bool better = is_good(other) && (!is_good(found) || other.overlap >= found.overlap);
  if (!better) return found;
  current_ = nearest;
  return other;
}

bool Tracker::recover(const ContactView& view) {
  // A keyframe's pose moved to where the contact is now, turned about the normal; another attempt
  // with every frame.
  constexpr std::array kTurns{0.0, 0.2, -0.2, 0.4, -0.4, 0.7, -0.7};
  const auto attempt = static_cast<std::size_t>(attempt_++);
  const std::size_t key = attempt % keyframes_.size();
  const double turn = kTurns[attempt / keyframes_.size() % kTurns.size()];
  const Keyframe& keyframe = keyframes_[key];
  const Eigen::Matrix3d rotation = Eigen::AngleAxisd(turn, view.upright()).toRotationMatrix();
  Motion start;
  start.rotation = rotation * keyframe.motion.rotation;
  start.translation = rotation * (keyframe.motion.translation - keyframe.centre) + view.centre();
  for (const Motion& from : {pose_.alignment.motion, start}) {
    const Alignment found = align(keyframe.surfels, view, from);
    // Stricter than while it is followed: nothing says that it is near.
    if (found.overlap < 0.6 || found.rms > kGoodRms / 2) continue;
    pose_.alignment = found;
    current_ = key;
    attempt_ = 0;
    return true;
  }
  return false;
}

const Tracker::Pose& Tracker::follow(const ContactView& view, std::uint64_t sequence) {
  if (keyframes_.empty()) {
    pose_ = {};
    if (view.pixels() < kFewestPixels) return pose_;
    add_keyframe(view);
    // With itself: which directions it shows.
    pose_ = {State::started, sequence, align(keyframes_[0].surfels, view, {})};
    pose_.alignment.motion = {};
    return pose_;
  }
  if (pose_.state == State::lost) {
    if (view.pixels() >= kFewestPixels && recover(view)) pose_.state = State::recovered;
    return pose_;
  }
  const Motion before = pose_.alignment.motion;
  const Alignment found = view.pixels() < kFewestPixels ? Alignment{} : best(view, before);
  if (!is_good(found) || !is_near(before, found.motion, found.centre)) {
    pose_.state = State::lost;
    attempt_ = 0;
    return pose_;
  }
  pose_.state = State::tracked;
  pose_.alignment = found;
  if (view.pixels() >= kGrown * keyframes_[current_].pixels) {
    // In its place: the tip of what was just touched lies on all that is touched later, and turns
    // on it as it likes.
    keyframes_[current_] = keyframe_of(view);
  } else if (found.overlap < kSharedOverlap) {
    add_keyframe(view);
  }
  return pose_;
}

}  // namespace dtact::perceive
