#pragma once

#include <cstdint>
#include <future>
#include <memory>
#include <optional>
#include <stop_token>

#include "clients/perceive/pose/hidden.hpp"
#include "clients/perceive/pose/object_model.hpp"
#include "clients/perceive/pose/placement_search.hpp"
#include "clients/perceive/pose/tracker.hpp"

namespace dtact::perceive {

/// What an ObjectTracker waits for.
struct SearchUnderWay {
  std::stop_source stop;  ///< Asked for once the contact is another one.
  std::future<std::optional<Placement>> result;
  Motion contact;   ///< The contact's motion at its frame.
  double area = 0;  ///< Of the contact then, square metres.
};

/// Follows a known object: where it is, in the surface frame. A Tracker follows the contact from
/// frame to frame. Beside it, on another thread, the object is searched for in what one frame
/// showed; what the contact has moved by since then is added to what is found. From there on each
/// frame is aligned with the object itself, so that nothing adds up, along the directions that its
/// touched shape shows; along the others the contact's motion is taken. Along those that neither
/// shows nobody follows it: they are told as unknown until a search has found it again.
class ObjectTracker {
 public:
  explicit ObjectTracker(std::shared_ptr<const ObjectModel> object) : object_(std::move(object)) {}
  ~ObjectTracker() { stop_search(); }
  ObjectTracker(const ObjectTracker&) = delete;
  ObjectTracker& operator=(const ObjectTracker&) = delete;

  /// The next frame, seen as ContactView says. A search that was begun is not waited for, but for
  /// the end of this object's life.
  const Tracker::Pose& follow(const ContactView& view, std::uint64_t sequence);
  /// Nothing touches any more: what comes is another contact.
  void release();
  [[nodiscard]] const Tracker::Pose& pose() const noexcept { return pose_; }
  [[nodiscard]] const ObjectModel& object() const noexcept { return *object_; }
  /// A search is under way.
  [[nodiscard]] bool is_searching() const noexcept { return search_.has_value(); }
  /// Waits for its end; the next frame makes use of it. For studies that are not made in real time.
  void wait() const {
    if (search_) search_->result.wait();
  }

 private:
  /// Moves the place as the contact moved.
  void follow_contact(const ContactView& view, std::uint64_t sequence);
  void begin_search(const ContactView& view);
  /// What it finds is another contact's.
  void stop_search() {
    if (search_) search_->stop.request_stop();
  }
  /// A search or what it found explains nothing: the next one waits, each time for longer.
  void in_vain();
  /// The end of a search, if it is over: what it found, moved to the present frame.
  [[nodiscard]] std::optional<Placement> finished();
  /// Aligned with the object from `start` on; nothing where that does not explain the frame.
  [[nodiscard]] std::optional<Alignment> align_object(const ContactView& view,
                                                      const Motion& start) const;

  std::shared_ptr<const ObjectModel> object_;
  Tracker contact_;
  std::optional<SearchUnderWay> search_;
  std::optional<Placement> placement_;  ///< Its centre and hidden twists in the object's frame.
  /// What neither the touched shape nor, since the search, anything else has shown.
  Hidden hidden_;
  Motion place_;  ///< Where the object is, as far as its contact tells.
  double searched_area_ = 0;
  int pause_ = 0;       ///< Frames until the next search may begin.
  int next_pause_ = 0;  ///< After one in vain; 0: the shortest.
  bool forgot_ = false;
  /// The contact was lost since the last search that found it: flat faces fit where it was as well.
  bool strayed_ = false;
  Tracker::Pose pose_;
};

}  // namespace dtact::perceive
