#include "daemon/pipeline/untouched/place_watch.hpp"

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <new>
#include <utility>

namespace dtact::pipeline {

PlaceWatch::PlaceWatch(int width, int height, int frames, base::SideThread& thread)
    : width_(width), average_(width, height, frames), compare_(thread, [this] { judge(); }) {
  job_.image_q8.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
}

void PlaceWatch::use_marks(std::shared_ptr<const LayerMarks> then) noexcept {
  then_ = std::move(then);
  ++epoch_;
  hurry();
}

void PlaceWatch::hurry() noexcept {
  due_ns_ = INT64_MIN;
  average_.reset();
}

void PlaceWatch::look(const hal::LumaView& luma, bool untouched, std::int64_t now_ns) noexcept {
  if (!then_ || now_ns < due_ns_ || compare_.busy()) return;
  if (!untouched) {
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

std::string PlaceWatch::message() const {
  const std::scoped_lock lock(mutex_);
  return message_;
}

void PlaceWatch::judge() {
  try {
    compare();
  } catch (const std::bad_alloc&) {
    moved_.store(0, std::memory_order_release);  // nothing is known; it looks again after the pause
  }
  job_.then.reset();
}

void PlaceWatch::compare() {
  const auto move = job_.then->moved_to(LayerMarks(job_.image_q8, width_, job_.then->part()));
  if (move) {
    const std::scoped_lock lock(mutex_);
    message_ =
        fmt::format("They are about {} px {} and {} px {} of there", std::abs(move->x),
                    move->x < 0 ? "left" : "right", std::abs(move->y), move->y < 0 ? "up" : "down");
    if (move->turn_deg != 0) {
      message_ += fmt::format(", turned by {} degrees {}", std::abs(move->turn_deg),
                              move->turn_deg < 0 ? "anticlockwise" : "clockwise");
    }
    message_ += '.';
  }
  moved_.store(move ? job_.epoch : 0, std::memory_order_release);
}

}  // namespace dtact::pipeline
