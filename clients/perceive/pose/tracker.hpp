#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "clients/perceive/pose/alignment.hpp"
#include "clients/perceive/pose/hidden.hpp"

namespace dtact::perceive {

/// A smaller contact has no shape, square metres: 300 pixels of 0.0414 mm.
constexpr double kLeastArea = 5.13e-7;
/// What a good alignment has at most, metres.
constexpr double kGoodRms = 4e-5;

/// From one frame to the next what is followed may go from `a` to `b`: no more than a millimetre
/// and 14° about `at`, where the contact is after `b`, surface frame.
[[nodiscard]] bool is_near(const Motion& a, const Motion& b, const Eigen::Vector3d& at);

/// Follows an object from the frame in which it is first touched. What is seen of it then, and at
/// keyframes later, is kept as surfels where they lay in that first frame; a frame is aligned with
/// the oldest keyframe that it shares enough with, so that errors add up over keyframes and not
/// over frames, and are gone where it comes back.
class Tracker {
 public:
  enum class State : std::uint8_t {
    idle,     ///< Nothing touches.
    started,  ///< From this frame on.
    tracked,
    lost,       ///< No motion explains the frame; `motion` is the last one that was known.
    recovered,  ///< Tracked again.
    searching   ///< Of an ObjectTracker: no place of the object is known yet.
  };
  struct Pose {
    State state = State::idle;
    std::uint64_t since = 0;  ///< Sequence of the frame that it is measured from.
    Alignment alignment;
    std::uint32_t alternatives = 0;  ///< Of an ObjectTracker: as Placement has them.
  };

  /// The next frame, seen as ContactView says.
  const Pose& follow(const ContactView& view, std::uint64_t sequence);
  /// Nothing touches any more: what comes is another contact.
  void release();
  /// `unobservable` of its alignment has what was not seen on the way as well.
  [[nodiscard]] const Pose& pose() const noexcept { return pose_; }
  /// What the last frame alone does not show of the motion since its keyframe; as twists of
  /// pose().alignment.
  [[nodiscard]] const std::vector<Twist>& unseen() const noexcept { return unseen_; }

 private:
  struct Keyframe {
    std::vector<Surfel> surfels;  ///< As they lay in the first frame.
    Motion motion;
    Hidden hidden;                                     ///< Along which `motion` is not known.
    double deepest = 0;                                ///< Of the contact then, metres.
    double area = 0;                                   ///< Of the contact then, square metres.
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< Of the contact then, surface frame.
  };

  /// What is seen now, laid back by the present motion.
  [[nodiscard]] Keyframe keyframe_of(const ContactView& view) const;
  void add_keyframe(const ContactView& view);
  /// What its keyframe does not know of its own motion is not known of this frame's either.
  void tell_hidden();
  /// The oldest keyframe of which most is in view, since errors have added up least until then;
  /// where there is none, the one of which most is.
  [[nodiscard]] std::size_t oldest_shared(const ContactView& view, const Motion& from) const;
  [[nodiscard]] Alignment best(const ContactView& view, const Motion& from);
  [[nodiscard]] bool recover(const ContactView& view);

  std::vector<Keyframe> keyframes_;
  std::size_t current_ = 0;
  int attempt_ = 0;
  Pose pose_;
  std::vector<Twist> unseen_;
};

}  // namespace dtact::perceive
