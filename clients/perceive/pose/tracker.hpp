#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "clients/perceive/pose/alignment.hpp"

namespace dtact::perceive {

/// A smaller contact has no shape, square metres: 300 pixels of 0.0414 mm.
constexpr double kMinArea = 5.13e-7;

/// Tracks an object from its first frame of contact. Keyframes, the first frame among them, hold
/// the gel as surfels in the coordinates of the first frame. Each frame is aligned with the oldest
/// keyframe that it overlaps enough with. So errors add up over keyframes and not over frames, and
/// vanish when the object returns.
class Tracker {
 public:
  enum class State : std::uint8_t {
    idle,       ///< No contact.
    started,    ///< The motion is measured from this frame on.
    tracked,    ///< The motion is known.
    lost,       ///< No motion explains the frame; `motion` is the last one known.
    recovered,  ///< Tracked again after a loss.
    searching   ///< ObjectTracker only: the object has not been found yet.
  };
  struct Pose {
    State state = State::idle;
    std::uint64_t since = 0;  ///< Sequence of the frame that the motion is measured from.
    Alignment alignment;
    std::vector<Twist> unobservable;  ///< From unobservable_of().
    std::uint32_t alternatives = 0;   ///< ObjectTracker only: Placement::alternatives.
    /// The motion can be used.
    [[nodiscard]] bool valid() const noexcept {
      return state == State::started || state == State::tracked || state == State::recovered;
    }
  };

  /// Tracks the next frame. A track that is lost is searched for in each frame; after kMaxLost
  /// frames in vain another one is started.
  const Pose& follow(const ContactView& view, std::uint64_t sequence);
  /// The contact has ended: the next frame begins another one.
  void release();
  [[nodiscard]] const Pose& pose() const noexcept { return pose_; }

  static constexpr int kMaxLost = 25;

 private:
  struct Keyframe {
    std::vector<Surfel> surfels;  ///< In the coordinates of the first frame.
    Motion motion = Motion::Identity();
    Matrix6 covariance;  ///< Covariance of `motion`'s error.
    double deepest = 0;  ///< The contact's depth, metres.
    double area = 0;     ///< Square metres.
    Eigen::Vector3d centre;
  };

  void start(const ContactView& view, std::uint64_t sequence);
  [[nodiscard]] Keyframe keyframe_of(const ContactView& view) const;
  void add_keyframe(const ContactView& view);
  /// Takes a frame's alignment with the current keyframe.
  void take(Alignment alignment, State state);
  /// The oldest keyframe of which most is in view; where there is none, the one of which most is.
  [[nodiscard]] std::size_t oldest_shared(const ContactView& view, const Motion& from) const;
  [[nodiscard]] bool relocalise(const ContactView& view);

  std::vector<Keyframe> keyframes_;
  std::size_t current_ = 0;
  int lost_ = 0;  ///< Frames since the loss.
  Pose pose_;
};

}  // namespace dtact::perceive
