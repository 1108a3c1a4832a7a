#pragma once

#include <cstdint>
#include <future>
#include <memory>
#include <optional>
#include <stop_token>

#include "clients/perceive/pose/object_model.hpp"
#include "clients/perceive/pose/placement_search.hpp"
#include "clients/perceive/pose/tracker.hpp"

namespace dtact::perceive {

/// Tracks a known object: its pose in the surface frame. A Tracker tracks the contact from frame to
/// frame. Another thread searches for the object in what one frame showed; what the contact has
/// moved by since then is added to what is found. The search is repeated once the contact shows
/// more, and after a loss.
class ObjectTracker {
 public:
  explicit ObjectTracker(std::shared_ptr<const ObjectModel> object) : object_(std::move(object)) {}
  ~ObjectTracker() { stop_search(); }
  ObjectTracker(const ObjectTracker&) = delete;
  ObjectTracker& operator=(const ObjectTracker&) = delete;

  /// Tracks the next frame. Does not wait for a search; only the destructor does.
  const Tracker::Pose& follow(const ContactView& view, std::uint64_t sequence);
  /// The contact has ended: the next frame begins another one.
  void release();
  [[nodiscard]] const Tracker::Pose& pose() const noexcept { return pose_; }
  [[nodiscard]] const ObjectModel& object() const noexcept { return *object_; }
  [[nodiscard]] bool is_searching() const noexcept { return search_.has_value(); }
  /// Waits for the end of a search; the next frame uses its result. For runs faster than real time.
  void wait() const {
    if (search_) search_->result.wait();
  }

 private:
  struct Search {
    std::stop_source stop;
    std::future<std::optional<Placement>> result;
    Motion contact = Motion::Identity();  ///< The contact's motion at its frame.
    double area = 0;                      ///< The contact's area then, square metres.
  };

  void begin_search(const ContactView& view);
  void stop_search() {
    if (search_) search_->stop.request_stop();
  }
  /// Takes the result of a search that is over. Returns true if it contradicts the placement so
  /// far.
  bool finish_search();

  std::shared_ptr<const ObjectModel> object_;
  Tracker contact_;
  std::optional<Search> search_;
  std::optional<Placement> placement_;  ///< Relative to the contact's first frame.
  double searched_area_ = 0;            ///< The contact's in the last search; 0: none yet.
  int pause_ = 0;                       ///< Frames until the next search may begin.
  int next_pause_ = 0;                  ///< After a search that found nothing; 0: the shortest.
  std::optional<std::uint64_t> since_;  ///< Frame in which the object was found first.
  Tracker::Pose pose_;
};

}  // namespace dtact::perceive
