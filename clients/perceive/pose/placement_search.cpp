#include "clients/perceive/pose/placement_search.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "clients/perceive/pose/placement.hpp"

namespace dtact::perceive {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// Evenly on the sphere: 5° from one to the next.
constexpr int kDirections = 1600;
constexpr int kTurns = 36;
/// Turns of a direction that are looked at more closely.
constexpr std::size_t kTurnsKept = 4;
/// Samples of the core for a first impression, and the limit of their distances, metres; for a
/// closer look.
constexpr std::size_t kFirstSamples = 60;
constexpr double kFirstLimit = 2e-4;
constexpr std::size_t kSamples = 200;
/// The object's lowest part is what is within the core's height and this, metres.
constexpr double kLift = 8e-5;
/// Height up to which the object may collide with the gel, metres.
constexpr double kInTheWay = 1e-3;
/// Its area is the core's within this factor: the core ends short of edges.
constexpr double kAreaFactor = 4;
constexpr double kFirstStep = 3e-4;
constexpr double kFirstLast = 8e-5;
constexpr double kStep = 2e-4;
constexpr double kLast = 1e-5;
constexpr std::size_t kImpressions = 500;
constexpr std::size_t kCandidates = 64;
/// Nearer than this is the same: radians, metres.
constexpr double kSameTurn = 0.26;
constexpr double kSamePlace = 4e-4;
/// A motion of which no more than this part is not along hidden twists leads to the same placement.
constexpr double kOnTheWay = 0.3;
/// What explains a contact has this score, and what explains it as well lacks no more than this.
constexpr double kExplained = 0.5;
constexpr double kAsWell = 0.06;

struct Candidate {
  Matrix3d turn;                      ///< The object's frame to the underside's.
  Motion move = Motion::Identity();   ///< The contact's frame to the underside's.
  Motion place = Motion::Identity();  ///< The object's frame to the contact's.
  double score = 0;
  bool present = false;
};

/// The twist about `centre`, its rotation times `arm`, that is `motion` after unit time: a screw.
Twist screw_of(const Motion& motion, const Vector3d& centre, double arm) {
  const Eigen::AngleAxisd turn(motion.linear());
  const double angle = turn.angle();
  const Vector3d& axis = turn.axis();
  const Vector3d shift = motion * centre - centre;
  Vector3d along = shift;
  // The inverse of the left Jacobian of SO(3): Barfoot, State Estimation for Robotics, 7.1.3.
  constexpr double kMinAngle = 1e-6;
  if (angle > kMinAngle) {
    const double half = angle / 2;
    const double cotangent = half / std::tan(half);
    along = cotangent * shift + (1 - cotangent) * axis * axis.dot(shift) - half * axis.cross(shift);
  }
  Twist twist;
  twist << arm * angle * axis, along;
  return twist;
}

/// Its last row is `up`.
Matrix3d turn_to(const Vector3d& up) {
  Matrix3d turn;
  turn << up.unitOrthogonal().transpose(), Eigen::RowVector3d::Zero(), up.transpose();
  turn.row(1) = up.cross(turn.row(0).transpose()).transpose();
  return turn;
}

class Search {
 public:
  Search(const ObjectModel& object, const ContactPatch& patch, const std::stop_token& stop)
      : object_(object),
        patch_(patch),
        stop_(stop),
        some_(thinned(patch, kSamples)),
        few_(thinned(patch, kFirstSamples)) {}

  std::optional<Placement> run(const std::optional<Motion>& present) {
    for (const Vector3d& down : object_.rests) look(turn_to(-down));
    for (const Vector3d& down : all_directions(kDirections)) look(turn_to(-down));
    keep(kImpressions);
    hill_climb_all(few_, kFirstStep, kFirstLast);
    keep_apart();
    if (present) add_present(*present);
    hill_climb_all(some_, kStep, kLast);
    keep(candidates_.size());
    if (stop_.stop_requested()) return std::nullopt;
    if (candidates_.empty() || candidates_.front().score < kExplained) return std::nullopt;
    return best();
  }

 private:
  [[nodiscard]] BottomView bottom_view_of(const Matrix3d& turn) const {
    return {object_, turn, patch_.highest - patch_.lowest + kInTheWay};
  }
  [[nodiscard]] static Motion place_of(const BottomView& bottom, const Motion& move) {
    return move.inverse() * bottom.from_object();
  }

  /// The contact turned by `angle`, its core's middle on `low`'s.
  [[nodiscard]] Motion laid(const BottomView& bottom, const Eigen::Vector2d& low,
                            double angle) const {
    Motion move = Motion::Identity();
    move.linear() = Eigen::AngleAxisd(angle, Vector3d::UnitZ()).toRotationMatrix();
    move.translation() = -(move.linear() * patch_.middle);
    move.translation().head<2>() += low;
    move.translation().z() = -patch_.lowest;
    // If its lowest part is not in contact, the object is less deep.
    std::array<double, kFirstSamples> gaps{};
    std::size_t count = 0;
    for (const auto& sample : few_.core) {
      const Vector3d point = move * sample.point;
      const Surfel* surfel = bottom.at(point);
      if (surfel != nullptr && count < gaps.size()) {
        gaps.at(count++) = surfel->point.z() - point.z();
      }
    }
    if (count == 0) return move;
    const auto middle = gaps.begin() + static_cast<std::ptrdiff_t>(count / 2);
    std::nth_element(gaps.begin(), middle, gaps.begin() + static_cast<std::ptrdiff_t>(count));
    constexpr double kMaxGap = 3e-4;
    move.translation().z() += std::clamp(*middle, -kMaxGap, kMaxGap);
    return move;
  }

  void look(const Matrix3d& turn) {
    if (stop_.stop_requested()) return;
    const BottomView bottom = bottom_view_of(turn);
    const BottomView::Low low = bottom.below(patch_.highest - patch_.lowest + kLift);
    if (low.area * kAreaFactor < patch_.area || low.area > kAreaFactor * patch_.area) return;
    std::array<std::pair<double, Motion>, kTurns> turns;
    for (int i = 0; i < kTurns; ++i) {
      const Motion move = laid(bottom, low.middle, 2 * std::numbers::pi * i / kTurns);
      turns.at(static_cast<std::size_t>(i)) = {score_of(bottom, few_, move, kFirstLimit), move};
    }
    std::partial_sort(turns.begin(), turns.begin() + kTurnsKept, turns.end(),
                      [](const auto& a, const auto& b) { return a.first > b.first; });
    for (std::size_t i = 0; i < kTurnsKept; ++i) {
      candidates_.push_back({turn, turns.at(i).second, {}, turns.at(i).first, false});
    }
  }

  void keep(std::size_t most) {
    std::ranges::sort(candidates_, std::ranges::greater{}, &Candidate::score);
    if (candidates_.size() > most) candidates_.resize(most);
  }

  void hill_climb_all(const ContactPatch& patch, double step, double last) {
    for (Candidate& one : candidates_) {
      if (stop_.stop_requested()) return;
      const BottomView bottom = bottom_view_of(one.turn);
      const ScoredPose improved = hill_climb(bottom, patch, one.move, step, last);
      one.move = improved.move;
      one.place = place_of(bottom, improved.move);
      one.score = improved.score;
    }
  }

  void add_present(const Motion& pose) {
    Candidate& one = candidates_.emplace_back();
    one.place = patch_.frame.inverse() * pose;
    one.turn = one.place.linear();
    one.move = bottom_view_of(one.turn).from_object() * one.place.inverse();
    one.present = true;
  }

  /// What moves one placement to another.
  [[nodiscard]] Twist between(const Candidate& a, const Candidate& b) const {
    return screw_of(b.place * a.place.inverse(), patch_.middle, patch_.arm);
  }
  [[nodiscard]] bool near(const Twist& twist) const {
    return twist.head<3>().norm() < kSameTurn * patch_.arm && twist.tail<3>().norm() < kSamePlace;
  }

  /// The best, each not near a better one.
  void keep_apart() {
    keep(candidates_.size());
    std::vector<Candidate> kept;
    for (const Candidate& one : candidates_) {
      const bool apart = std::ranges::none_of(
          kept, [&](const Candidate& better) { return near(between(one, better)); });
      if (apart) kept.push_back(one);
      if (kept.size() == kCandidates) break;
    }
    candidates_ = std::move(kept);
  }

  [[nodiscard]] Placement best() const {
    const double most = candidates_.front().score;
    const auto present = std::ranges::find(candidates_, true, &Candidate::present);
    const bool stays = present != candidates_.end() && present->score >= most - kAsWell;
    const Candidate& first = stays ? *present : candidates_.front();
    const BottomView bottom = bottom_view_of(first.turn);
    const ScoredPose improved = hill_climb(bottom, patch_, first.move, kStep, kLast);
    const std::vector<Twist> unobservable = unobservable_twists(bottom, patch_, improved.move);
    const auto same = [&](const Candidate& a, const Candidate& b) {
      const Twist twist = between(a, b);
      Twist rest = twist;
      for (const Twist& one : unobservable) rest -= one * one.dot(twist);
      return near(twist) || near(rest) || rest.norm() < kOnTheWay * twist.norm();
    };
    std::vector<const Candidate*> families{&first};
    for (const Candidate& one : candidates_) {
      if (one.score < most - kAsWell) break;
      const bool another =
          std::ranges::none_of(families, [&](const Candidate* known) { return same(*known, one); });
      if (another) families.push_back(&one);
    }
    Placement found;
    found.pose = patch_.frame * place_of(bottom, improved.move);
    found.score = improved.score;
    found.kept = stays;
    found.covariance =
        carried(unknown_along(unobservable, patch_.middle, patch_.arm), patch_.frame);
    found.alternatives = static_cast<std::uint32_t>(families.size() - 1);
    return found;
  }

  const ObjectModel& object_;
  const ContactPatch& patch_;
  const std::stop_token& stop_;
  ContactPatch some_;
  ContactPatch few_;
  std::vector<Candidate> candidates_;
};

}  // namespace

std::optional<Placement> search(const ObjectModel& object, const ContactPatch& patch,
                                const std::optional<Motion>& present, const std::stop_token& stop) {
  constexpr std::size_t kFewest = 20;
  if (patch.core.size() < kFewest) return std::nullopt;
  return Search(object, patch, stop).run(present);
}

}  // namespace dtact::perceive
