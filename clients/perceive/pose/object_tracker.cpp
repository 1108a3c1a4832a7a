#include "clients/perceive/pose/object_tracker.hpp"

#include <algorithm>
#include <chrono>
#include <system_error>
#include <utility>

#include "clients/perceive/pose/contact_patch.hpp"

namespace dtact::perceive {
namespace {

/// A contact that has grown by this factor shows more of the object: the search is repeated.
constexpr double kSearchGrown = 1.5;
/// Frames until the next search after one without result, unless the contact grows; doubles each
/// time, up to kMaxPause.
constexpr int kPause = 30;
constexpr int kMaxPause = 600;

}  // namespace

void ObjectTracker::release() {
  contact_.release();
  placement_.reset();
  since_.reset();
  stop_search();
  searched_area_ = 0;
  pause_ = next_pause_ = 0;
  pose_ = {};
}

void ObjectTracker::begin_search(const ContactView& view) {
  Search search;
  search.contact = contact_.pose().alignment.motion;
  search.area = view.area();
  std::optional<Motion> present;
  if (placement_) present = search.contact * placement_->pose;
  try {
    search.result = std::async(std::launch::async, [object = object_, patch = make_patch(view),
                                                    present, stop = search.stop.get_token()] {
      return perceive::search(*object, patch, present, stop);
    });
  } catch (const std::system_error&) {
    pause_ = kPause;  // No thread is available now.
    return;
  }
  search_ = std::move(search);
}

bool ObjectTracker::finish_search() {
  if (!search_ || search_->result.wait_for(std::chrono::seconds(0)) != std::future_status::ready) {
    return false;
  }
  std::optional<Placement> found = search_->result.get();
  const Search search = std::move(*search_);
  search_.reset();
  if (search.stop.stop_requested()) return false;
  searched_area_ = search.area;
  if (!found) {
    pause_ = std::max(kPause, next_pause_);
    next_pause_ = std::min(2 * pause_, kMaxPause);
    return false;
  }
  next_pause_ = 0;
  const Motion back = search.contact.inverse();
  found->pose = back * found->pose;
  found->covariance = carried(found->covariance, back);
  const bool contradicts = placement_ && !found->kept;
  placement_ = std::move(found);
  return contradicts;
}

const Tracker::Pose& ObjectTracker::follow(const ContactView& view, std::uint64_t sequence) {
  using State = Tracker::State;
  const std::uint64_t before = contact_.pose().since;
  const Tracker::Pose& contact = contact_.follow(view, sequence);
  if (contact.state == State::lost) {
    // A search in this frame finds the object no later than the track would be found again.
    contact_.release();
    (void)contact_.follow(view, sequence);
  }
  if (contact.state == State::idle && pose_.state == State::idle) return pose_;
  if (contact.state == State::started && contact.since != before) {
    // Another track: where the object lies in it is not known.
    stop_search();
    placement_.reset();
    searched_area_ = 0;
    pause_ = 0;
  }
  const bool contradicted = finish_search();
  const bool goes_on = pose_.valid() && !contradicted;
  if (placement_ && contact.valid()) {
    pose_.state = goes_on ? State::tracked : since_ ? State::recovered : State::started;
    if (!since_) since_ = sequence;
    pose_.since = *since_;
    pose_.alternatives = placement_->alternatives;
    pose_.alignment = contact.alignment;
    const Motion& moved = contact.alignment.motion;
    pose_.alignment.motion = moved * placement_->pose;
    pose_.alignment.covariance += carried(placement_->covariance, moved);
    pose_.unobservable = unobservable_of(pose_.alignment.covariance, contact.alignment.centre,
                                         contact.alignment.arm);
  } else {
    pose_.state = since_ ? State::lost : State::searching;
  }
  if (pause_ > 0) --pause_;
  const bool grown = searched_area_ > 0 && view.area() >= kSearchGrown * searched_area_;
  const bool again = grown || (!placement_ && pause_ == 0);
  if (!search_ && again && contact.valid() && view.area() >= kMinArea) begin_search(view);
  return pose_;
}

}  // namespace dtact::perceive
