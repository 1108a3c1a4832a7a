#include "clients/perceive/pose/tracker.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <utility>

namespace dtact::perceive {
namespace {

using Eigen::Vector3d;

constexpr std::size_t kSurfels = 1500;
/// A contact that has grown by this factor shows what its keyframe lacks.
constexpr double kGrown = 1.5;
/// What a good alignment has at least; through the daemon those of fifteen objects that turn, slide
/// and roll have a fit above 0.95. A frame becomes a keyframe where it shares less than kShared
/// with every other one, or where less than kWellExplained of what it shares fits.
constexpr double kMinOverlap = 0.4;
constexpr double kMinFit = 0.6;
constexpr double kShared = 0.7;
constexpr double kWellExplained = 0.8;
constexpr std::size_t kMaxKeyframes = 16;
/// A larger motion in one frame is not tracked but searched for: metres, radians.
constexpr double kMaxSlide = 1e-3;
constexpr double kMaxTurn = 0.25;

/// Root mean square distance that a good alignment has at most, metres: what the stated uncertainty
/// allows.
double max_rms(const ContactView& view) { return std::max(6e-5, 1.5 * view.uncertainty()); }

bool is_good(const Alignment& alignment, const ContactView& view) {
  return alignment.overlap >= kMinOverlap && alignment.fit >= kMinFit &&
         alignment.rms <= max_rms(view);
}

/// What is moved from `a` to `b` moves by little about `at`, where the contact is after `b`.
bool is_near(const Motion& a, const Motion& b, const Vector3d& at) {
  const Motion back = a * b.inverse();
  return (back * at - at).norm() <= kMaxSlide &&
         Eigen::AngleAxisd(back.linear()).angle() <= kMaxTurn;
}

}  // namespace

void Tracker::release() {
  keyframes_.clear();
  pose_ = {};
}

Tracker::Keyframe Tracker::keyframe_of(const ContactView& view) const {
  Keyframe key;
  key.motion = pose_.alignment.motion;
  key.covariance = pose_.alignment.covariance;
  key.area = view.area();
  key.deepest = view.deepest();
  key.centre = view.centre();
  key.surfels = view.surfels(kSurfels);
  const Motion back = key.motion.inverse();
  for (Surfel& surfel : key.surfels) {
    surfel.point = back * surfel.point;
    surfel.edge = back * surfel.edge;
    surfel.normal = back.linear() * surfel.normal;
  }
  return key;
}

void Tracker::add_keyframe(const ContactView& view) {
  Keyframe key = keyframe_of(view);
  if (keyframes_.size() == kMaxKeyframes) {
    // The one of the object's furthest part goes; the first stays, which has no error.
    const Vector3d here = key.motion.inverse() * key.centre;
    const auto distance = [&here](const Keyframe& one) {
      return (one.motion.inverse() * one.centre - here).norm();
    };
    keyframes_.erase(
        std::ranges::max_element(keyframes_.begin() + 1, keyframes_.end(), {}, distance));
  }
  keyframes_.push_back(std::move(key));
  current_ = keyframes_.size() - 1;
}

void Tracker::start(const ContactView& view, std::uint64_t sequence) {
  release();
  if (view.area() < kMinArea) return;
  add_keyframe(view);
  // Aligned with itself: which directions the shape determines.
  const Alignment own = align(keyframes_.front().surfels, view, Motion::Identity());
  pose_ = {State::started, sequence, own, unobservable_of(own.covariance, own.centre, own.arm), 0};
  pose_.alignment.motion = Motion::Identity();
}

void Tracker::take(Alignment alignment, State state) {
  const Keyframe& key = keyframes_[current_];
  alignment.covariance += carried(key.covariance, alignment.motion * key.motion.inverse());
  pose_.unobservable = unobservable_of(alignment.covariance, alignment.centre, alignment.arm);
  pose_.alignment = std::move(alignment);
  pose_.state = state;
  lost_ = 0;
}

std::size_t Tracker::oldest_shared(const ContactView& view, const Motion& from) const {
  constexpr std::size_t kProbes = 60;
  std::size_t chosen = current_;
  double most = 0;
  for (std::size_t i = 0; i < keyframes_.size(); ++i) {
    const std::vector<Surfel>& surfels = keyframes_[i].surfels;
    const std::size_t every = 1 + surfels.size() / kProbes;
    std::size_t probes = 0;
    std::size_t met = 0;
    for (std::size_t k = 0; k < surfels.size(); k += every, ++probes) {
      const auto sample = view.at(from * surfels[k].point);
      if (sample && sample->depth > view.pressed()) ++met;
    }
    const double part = static_cast<double>(met) / static_cast<double>(probes);
    if (part >= kShared) return i;
    if (part > most) {
      most = part;
      chosen = i;
    }
  }
  return chosen;
}

bool Tracker::relocalise(const ContactView& view) {
  // Starts from the last pose, and from a keyframe moved to the present contact and rotated about
  // the normal. Each frame tries another angle.
  constexpr std::array kTurns{0.0, 0.25, -0.25, 0.5, -0.5, 0.9, -0.9, 1.4, -1.4, 2.1, -2.1, 3.1};
  const auto attempt = static_cast<std::size_t>(lost_ - 1);
  for (const std::size_t key : {current_, (current_ + attempt) % keyframes_.size()}) {
    const Keyframe& keyframe = keyframes_[key];
    Motion placed = Motion::Identity();
    placed.linear() =
        Eigen::AngleAxisd(kTurns.at(attempt % kTurns.size()), view.upright()).toRotationMatrix();
    placed.translation() = view.centre() - placed.linear() * keyframe.centre;
    for (const Motion& from : {pose_.alignment.motion, placed * keyframe.motion}) {
      Alignment found = align(keyframe.surfels, view, from);
      // Stricter than while it is tracked: nothing says that it is near.
      constexpr double kMinRelocalised = 0.6;
      if (found.overlap < kMinRelocalised || found.rms > max_rms(view) / 2) continue;
      current_ = key;
      take(std::move(found), State::recovered);
      return true;
    }
  }
  return false;
}

const Tracker::Pose& Tracker::follow(const ContactView& view, std::uint64_t sequence) {
  if (keyframes_.empty()) {
    start(view, sequence);
    return pose_;
  }
  if (pose_.state == State::lost) {
    ++lost_;
    if (view.area() >= kMinArea && !relocalise(view) && lost_ >= kMaxLost) start(view, sequence);
    return pose_;
  }
  const Motion before = pose_.alignment.motion;
  Alignment found;
  if (view.area() >= kMinArea) {
    const std::size_t oldest = oldest_shared(view, before);
    found = align(keyframes_[oldest].surfels, view, before);
    if (oldest != current_ && (!is_good(found, view) || found.overlap < kShared)) {
      const Alignment other = align(keyframes_[current_].surfels, view, before);
      if (is_good(found, view) && found.overlap >= other.overlap) {
        current_ = oldest;
      } else {
        found = other;
      }
    } else {
      current_ = oldest;
    }
  }
  if (!is_good(found, view) || !is_near(before, found.motion, found.centre)) {
    pose_.state = State::lost;
    lost_ = 0;
    return pose_;
  }
  take(std::move(found), State::tracked);
  if (view.area() >= kGrown * keyframes_[current_].area ||
      view.deepest() >= kGrown * keyframes_[current_].deepest) {
    // Replaces the keyframe: the tip in contact first fits all later contacts at any angle. A
    // contact that is being pressed in is assumed not to slide meanwhile, so directions that its
    // tip does not determine add no uncertainty.
    const Matrix6 covariance = keyframes_[current_].covariance;
    keyframes_[current_] = keyframe_of(view);
    keyframes_[current_].covariance = covariance;
  } else if (pose_.alignment.overlap < kShared || pose_.alignment.fit < kWellExplained) {
    add_keyframe(view);
  }
  return pose_;
}

}  // namespace dtact::perceive
