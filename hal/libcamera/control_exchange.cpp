#include "hal/libcamera/control_exchange.hpp"

#include <exception>
#include <utility>

namespace dtact::hal::libcamera_backend {

namespace lc = libcamera;

void ControlExchange::change(const CameraChange& change, std::vector<CameraControl>& controls) {
  const std::lock_guard guard(mutex_);
  lc::ControlList list = PhotometricLock::changed_controls(change, controls);
  // merge() keeps what the list has, so the newer value stays.
  if (changed_) list.merge(*changed_);
  changed_ = std::move(list);
  frames_to_settle_ = kSettlingFrames;
}

void ControlExchange::add_changes(lc::ControlList& request) noexcept {
  const std::unique_lock guard(mutex_, std::try_to_lock);
  if (!guard || !changed_) return;
  request.merge(*changed_);
  changed_.reset();
}

void ControlExchange::read(const lc::ControlList& metadata) noexcept {
  // The watching thread allocates while it holds the mutex: not waited for, the next frame has them
  // too.
  const std::unique_lock guard(mutex_, std::try_to_lock);
  if (!guard) return;
  if (!changed_ && frames_to_settle_ > 0) --frames_to_settle_;
  try {
    PhotometricLock::read(metadata, readings_);
  } catch (const std::exception&) {
    readings_.clear();  // no memory for them: the next frame tries again
  }
}

bool ControlExchange::has_readings() const {
  const std::lock_guard guard(mutex_);
  return !readings_.empty();
}

bool ControlExchange::settled() const {
  const std::lock_guard guard(mutex_);
  return frames_to_settle_ == 0;
}

std::string ControlExchange::compare(std::vector<CameraControl>& controls) const {
  Readings readings;
  {
    const std::lock_guard guard(mutex_);
    if (frames_to_settle_ > 0) return {};
    readings = readings_;
  }
  return PhotometricLock::compare(readings, controls);
}

}  // namespace dtact::hal::libcamera_backend
