#include "clients/perceive/pose/object_tracker.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <span>
#include <system_error>
#include <utility>

#include "clients/perceive/pose/contact_patch.hpp"
#include "clients/perceive/pose/spread.hpp"

namespace dtact::perceive {
namespace {

using Eigen::Vector3d;

/// A contact that has grown so many times may tell apart what was alike: it is searched again.
constexpr double kGrownMuch = 2;
/// After a search that found nothing the next one waits for so many frames, twice as many each
/// time, or for so much growth.
constexpr int kPause = 30;
constexpr int kLongestPause = 600;
constexpr double kGrownInVain = 1.25;
/// Surfels that are looked at and compared, of those that may touch.
constexpr std::size_t kLookedAt = 3000;
constexpr std::size_t kCompared = 600;
/// What lies against the gel is so near to it, metres, and looks the same way within this cosine.
constexpr double kTouching = 1.5e-4;
constexpr double kSameWay = 0.7;
constexpr double kUpright = 0.1;
/// What a good alignment has at least, beside kGoodRms.
constexpr double kOverlap = 0.5;
constexpr double kArea = 0.1;  // of the contact

/// The surfels that touch where `place` puts the object, those that lie around the view.
std::vector<Surfel> touching(const ObjectModel& object, const ContactView& view,
                             const Motion& place) {
  const double reach = 0.75 * view.px() * std::max(view.cloud().width, view.cloud().height);
  std::vector<const Surfel*> around;
  for (const Surfel& surfel : object.surfels) {
    const Vector3d normal = place.rotation * surfel.normal;
    if (normal.dot(view.upright()) < kUpright) continue;
    if ((place * surfel.point - view.centre()).squaredNorm() < reach * reach) {
      around.push_back(&surfel);
    }
  }
  const std::size_t every = 1 + around.size() / kLookedAt;
  std::vector<Surfel> found;
  for (std::size_t i = 0; i < around.size(); i += every) {
    const Vector3d moved = place * around[i]->point;
    const auto sample = view.at(moved);
    if (!sample || std::abs(sample->normal.dot(moved - sample->point)) > kTouching) continue;
    if (sample->normal.dot(place.rotation * around[i]->normal) < kSameWay) continue;
    found.push_back(*around[i]);
  }
  const double area = object.spacing * object.spacing * static_cast<double>(found.size() * every);
  if (area < kArea * view.area()) found.clear();
  return found;
}

}  // namespace

void ObjectTracker::release() {
  contact_.release();
  placement_.reset();
  stop_search();
  searched_area_ = 0;
  pause_ = next_pause_ = 0;
  forgot_ = strayed_ = false;
  pose_ = {};
}

std::optional<Alignment> ObjectTracker::align_object(const ContactView& view,
                                                     const Motion& start) const {
  const std::vector<Surfel> near = touching(*object_, view, start);
  std::vector<Vector3d> normals;
  normals.reserve(near.size());
  for (const Surfel& surfel : near) normals.push_back(start.rotation * surfel.normal);
  std::vector<Surfel> chosen;
  for (const std::size_t i : spread(normals, kCompared)) chosen.push_back(near[i]);
  if (chosen.empty()) return std::nullopt;
  Alignment found = align(chosen, view, start);
  if (found.overlap < kOverlap || found.rms > kGoodRms) return std::nullopt;
  if (!is_near(start, found.motion, found.centre)) return std::nullopt;
  return found;
}

void ObjectTracker::in_vain() {
  pause_ = std::max(kPause, next_pause_);
  next_pause_ = std::min(2 * pause_, kLongestPause);
}

void ObjectTracker::begin_search(const ContactView& view) {
  SearchUnderWay search;
  search.contact = contact_.pose().alignment.motion;
  search.area = view.area();
  std::optional<Motion> present;
  if (placement_) present = place_;
  try {
    search.result = std::async(std::launch::async, [object = object_, patch = make_patch(view),
                                                    present, stop = search.stop.get_token()] {
      return perceive::search(*object, patch, present, stop);
    });
  } catch (const std::system_error&) {
    // No thread is to be had now.
    return in_vain();
  }
  search_ = std::move(search);
}

std::optional<Placement> ObjectTracker::finished() {
  if (!search_) return std::nullopt;
  if (search_->result.wait_for(std::chrono::seconds(0)) != std::future_status::ready) {
    return std::nullopt;
  }
  std::optional<Placement> found = search_->result.get();
  const SearchUnderWay search = std::move(*search_);
  search_.reset();
  if (search.stop.stop_requested()) return std::nullopt;
  searched_area_ = search.area;
  if (!found) {
    in_vain();
    return std::nullopt;
  }
  const Motion since = contact_.pose().alignment.motion * search.contact.inverse();
  const Motion back = found->pose.inverse();
  found->centre = back * found->centre;
  for (Twist& twist : found->hidden) {
    twist << back.rotation * twist.head<3>(), back.rotation * twist.tail<3>();
  }
  found->pose = since * found->pose;
  return found;
}

void ObjectTracker::follow_contact(const ContactView& view, std::uint64_t sequence) {
  const Motion before = contact_.pose().alignment.motion;
  (void)contact_.follow(view, sequence);
  if (contact_.pose().state != Tracker::State::lost) {
    place_ = contact_.pose().alignment.motion * before.inverse() * place_;
    return;
  }
  contact_.release();
  (void)contact_.follow(view, sequence);
  // What has moved since it began is not known.
  stop_search();
  strayed_ = placement_.has_value();
}

const Tracker::Pose& ObjectTracker::follow(const ContactView& view, std::uint64_t sequence) {
  using State = Tracker::State;
  if (view.area() < kLeastArea && pose_.state == State::idle) return pose_;
  follow_contact(view, sequence);
  const bool was_lost = pose_.state == State::lost;
  std::optional<Alignment> aligned;
  if (const std::optional<Placement> found = finished()) {
    aligned = align_object(view, found->pose);
    if (aligned) {
      if (!placement_) pose_.since = sequence;
      pose_.state = placement_ ? State::recovered : State::started;
      if (placement_ && !was_lost && is_near(place_, aligned->motion, aligned->centre)) {
        pose_.state = State::tracked;
      }
      placement_ = found;
      hidden_ = {found->hidden, found->centre, found->arm};
      forgot_ = strayed_ = false;
      pause_ = kPause;
      next_pause_ = 0;
    } else {
      in_vain();
    }
  }
  if (!aligned && placement_ && !strayed_) {
    aligned = align_object(view, place_);
    if (aligned) pose_.state = was_lost ? State::recovered : State::tracked;
  }
  if (aligned && placement_) {
    place_ = aligned->motion;
    pose_.alignment = *std::move(aligned);
    // What neither this frame's alignment with the object nor the contact's motion shows.
    Alignment& shown = pose_.alignment;
    const auto of_contact = seen_from(contact_.unseen(), contact_.pose().alignment, shown);
    forgot_ |= hidden_.add(in_both(shown.unobservable, of_contact), shown);
    shown.unobservable = in_both(shown.unobservable, hidden_.seen_at(shown));
    pose_.alternatives = placement_->alternatives;
  } else {
    if (placement_ && !was_lost) pause_ = 0;
    pose_.state = placement_ ? State::lost : State::searching;
  }
  const bool unknown_place = pose_.state == State::lost || pose_.state == State::searching;
  const auto times = [&](double factor) { return view.area() >= factor * searched_area_; };
  if (pause_ > 0) --pause_;
  const bool again = unknown_place ? pause_ == 0 || times(kGrownInVain)
                                   : times(kGrownMuch) || (forgot_ && pause_ == 0);
  if (!search_ && again && view.area() >= kLeastArea) begin_search(view);
  return pose_;
}

}  // namespace dtact::perceive
