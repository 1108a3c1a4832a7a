#include "clients/perceive/pose/tracker.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

namespace dtact::perceive {
namespace {

/// Surfels of a keyframe.
constexpr std::size_t kSurfels = 600;
/// A contact that has grown so many times shows what its keyframe lacks.
constexpr double kGrown = 2;
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
  if (!keyframes_.empty()) key.hidden = keyframes_[current_].hidden;
  key.area = view.area();
  key.deepest = view.deepest();
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
  Keyframe key = keyframe_of(view);
  key.hidden.add(pose_.alignment.unobservable, pose_.alignment);
  if (keyframes_.size() == kMostKeyframes) {
    // The one of the object's furthest part; the first stays, which has no error.
    const Eigen::Vector3d here = pose_.alignment.motion.inverse() * view.centre();
    const auto distance = [&here](const Keyframe& one) {
      return (one.motion.inverse() * one.centre - here).norm();
    };
    keyframes_.erase(
        std::ranges::max_element(keyframes_.begin() + 1, keyframes_.end(), {}, distance));
  }
  keyframes_.push_back(std::move(key));
  current_ = keyframes_.size() - 1;
}

void Tracker::tell_hidden() {
  Alignment& shown = pose_.alignment;
  unseen_ = shown.unobservable;
  Hidden all;
  all.add(unseen_, shown);
  all.add(keyframes_[current_].hidden.seen_at(shown), shown);
  shown.unobservable = all.seen_at(shown);
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
      if (view.at(from * surfels[k].point)) ++met;
    }
    const double part = static_cast<double>(met) / static_cast<double>(probes);
    if (part >= kSharedOverlap) return i;
    if (part > most) {
      most = part;
      chosen = i;
    }
  }
  return chosen;
}

Alignment Tracker::best(const ContactView& view, const Motion& from) {
  const std::size_t chosen = oldest_shared(view, from);
  Alignment found = align(keyframes_[chosen].surfels, view, from);
  if (chosen == current_) return found;
  if (!is_good(found) || found.overlap < kSharedOverlap) {
    const Alignment other = align(keyframes_[current_].surfels, view, from);
    if (is_good(other) && (!is_good(found) || other.overlap > found.overlap)) return other;
  }
  current_ = chosen;
  return found;
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
    if (view.area() < kLeastArea) return pose_;
    add_keyframe(view);
    // With itself: which directions it shows.
    pose_ = {State::started, sequence, align(keyframes_[0].surfels, view, {})};
    pose_.alignment.motion = {};
    tell_hidden();
    return pose_;
  }
  if (pose_.state == State::lost) {
    if (view.area() >= kLeastArea && recover(view)) {
      pose_.state = State::recovered;
      tell_hidden();
    }
    return pose_;
  }
  const Motion before = pose_.alignment.motion;
  const Alignment found = view.area() < kLeastArea ? Alignment{} : best(view, before);
  if (!is_good(found) || !is_near(before, found.motion, found.centre)) {
    pose_.state = State::lost;
    attempt_ = 0;
    return pose_;
  }
  pose_.state = State::tracked;
  pose_.alignment = found;
  if (view.area() >= kGrown * keyframes_[current_].area ||
      view.deepest() >= kGrown * keyframes_[current_].deepest) {
    // In its place: the tip of what was just touched lies on all that is touched later, and turns
    // on it as it likes; and of a light touch more of the gel only follows, which lies on nothing
    // later. A contact that is pressed in is not taken to slide meanwhile.
    keyframes_[current_] = keyframe_of(view);
  } else if (found.overlap < kSharedOverlap) {
    add_keyframe(view);
  }
  tell_hidden();
  return pose_;
}

}  // namespace dtact::perceive
