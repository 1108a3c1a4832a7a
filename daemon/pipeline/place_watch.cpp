#include "daemon/pipeline/place_watch.hpp"

#include <fmt/format.h>

#include <cstdlib>
#include <utility>

#include "daemon/pipeline/layer_marks.hpp"

namespace dtact::pipeline {

PlaceWatch::PlaceWatch(int width, int height, int frames)
    : width_(width), average_(width, height, frames) {
  job_.image_q8.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
}

void PlaceWatch::start() {
  stop_ = false;
  thread_ = base::RtThread({.name = "dtact-place", .cpu = {}}, [this] { run(); });
}

void PlaceWatch::stop() noexcept {
  stop_ = true;
  work_.ring();
  thread_.join();
}

void PlaceWatch::use_calibration(std::shared_ptr<const calibration::Calibration> calibration,
                                 const CellRegion& region) noexcept {
  calibration_ = std::move(calibration);
  region_ = region;
  ++epoch_;
  hurry();
}

void PlaceWatch::hurry() noexcept {
  due_ns_ = INT64_MIN;
  average_.reset();
}

void PlaceWatch::look(const hal::LumaView& luma, bool untouched, std::int64_t now_ns) noexcept {
  if (!calibration_ || now_ns < due_ns_ || full_.load(std::memory_order_acquire)) return;
  if (!untouched) {
    if (average_.added() > 0) average_.reset();
    return;
  }
  if (!average_.add(luma)) return;
  average_.write(job_.image_q8);
  average_.reset();
  job_.calibration = calibration_;
  job_.region = region_;
  job_.epoch = epoch_;
  due_ns_ = now_ns + kPauseNs;
  full_.store(true, std::memory_order_release);
  work_.ring();
}

std::string PlaceWatch::message() const {
  const std::scoped_lock lock(mutex_);
  return message_;
}

void PlaceWatch::settle() const noexcept { full_.wait(true, std::memory_order_acquire); }

void PlaceWatch::run() {
  for (;;) {
    work_.wait();
    if (full_.load(std::memory_order_acquire)) {
      judge();
      job_.calibration.reset();
      full_.store(false, std::memory_order_release);
      full_.notify_all();
    }
    if (stop_) return;
  }
}

void PlaceWatch::judge() {
  const recon::RectifyTable& table = job_.calibration->model->rectify;
  const int x = cell_edge(job_.region.x0, kGridWidth, table.frame_width);
  const int y = cell_edge(job_.region.y0, kGridHeight, table.frame_height);
  const recon::FrameRegion part{x, y, cell_edge(job_.region.x1, kGridWidth, table.frame_width) - x,
                                cell_edge(job_.region.y1, kGridHeight, table.frame_height) - y};
  const LayerMarks then(job_.calibration->model->reference_q8, width_, part);
  const auto move = then.moved_to(LayerMarks(job_.image_q8, width_, part));
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
