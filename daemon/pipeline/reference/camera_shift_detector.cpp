#include "daemon/pipeline/reference/camera_shift_detector.hpp"

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <new>
#include <utility>

namespace dtact::pipeline {

CameraShiftDetector::CameraShiftDetector(int width, int height, int frames,
                                         base::BackgroundThread& thread, int decode_scale)
    : width_(width),
      decode_scale_(decode_scale),
      average_(width, height, frames),
      compare_(thread, [this] { judge(); }) {
  job_.image_q8.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
}

void CameraShiftDetector::use_marks(std::shared_ptr<const GelMarks> then) noexcept {
  then_ = std::move(then);
  ++epoch_;
  check_now();
}

void CameraShiftDetector::check_now() noexcept {
  due_ns_ = INT64_MIN;
  average_.reset();
}

void CameraShiftDetector::look(const hal::LumaView& luma, bool no_contact,
                               std::int64_t now_ns) noexcept {
  if (!then_ || now_ns < due_ns_ || compare_.busy()) return;
  if (!no_contact) {
    if (average_.added() > 0) average_.reset();
    return;
  }
  if (!average_.add(luma)) return;
  average_.write(job_.image_q8);
  average_.reset();
  job_.then = then_;
  job_.epoch = epoch_;
  due_ns_ = now_ns + kPauseNs;
  compare_.hand_over();
}

std::string CameraShiftDetector::message() const {
  const std::scoped_lock lock(mutex_);
  return message_;
}

void CameraShiftDetector::judge() {
  try {
    compare();
  } catch (const std::bad_alloc&) {
    moved_.store(0, std::memory_order_release);  // nothing is known; it looks again after the pause
  }
  job_.then.reset();
}

void CameraShiftDetector::compare() {
  const auto move = job_.then->moved_to(GelMarks(job_.image_q8, width_, job_.then->part()));
  if (move) {
    const std::scoped_lock lock(mutex_);
    message_ = fmt::format("They are about {} px {} and {} px {} of there",
                           decode_scale_ * std::abs(move->x), move->x < 0 ? "left" : "right",
                           decode_scale_ * std::abs(move->y), move->y < 0 ? "up" : "down");
    if (move->turn_deg != 0) {
      message_ += fmt::format(", turned by {} degrees {}", std::abs(move->turn_deg),
                              move->turn_deg < 0 ? "anticlockwise" : "clockwise");
    }
    message_ += '.';
  }
  moved_.store(move ? job_.epoch : 0, std::memory_order_release);
}

}  // namespace dtact::pipeline
