#include "daemon/pipeline/pipeline.hpp"

#include <fmt/format.h>

#include <exception>
#include <stdexcept>
#include <utility>

namespace dtact::pipeline {
namespace {

hal::CameraInfo checked(const hal::CameraInfo& info) {
  if (info.width < kLeastFrameWidth || info.height < kLeastFrameHeight) {
    throw std::invalid_argument(
        fmt::format("camera {} delivers {}x{} pixels; at least {}x{} are needed: choose another "
                    "camera.width and camera.height",
                    info.identity, info.width, info.height, kLeastFrameWidth, kLeastFrameHeight));
  }
  if (!(info.fps > 0)) {
    throw std::invalid_argument(
        fmt::format("camera {} states no frame rate: set camera.fps above 0", info.identity));
  }
  return info;
}

HealthSet health_of(std::uint32_t bits) noexcept {
  HealthSet set;
  for (int i = 0; i < kHealthCount; ++i) {
    if ((bits >> static_cast<unsigned>(i) & 1U) != 0) set.set(static_cast<Health>(i));
  }
  return set;
}

std::size_t pixels(int width, int height) {
  return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
}

}  // namespace

Pipeline::Pipeline(std::unique_ptr<hal::Camera> camera, std::unique_ptr<hal::LightRing> ring,
                   const std::shared_ptr<const calibration::Calibration>& calibration,
                   PipelineConfig config, base::Clock& clock)
    : config_(std::move(config)),
      clock_(clock),
      camera_(std::move(camera)),
      info_(checked(camera_->info())),
      exchange_(prototype(calibration.get())),
      light_(std::move(ring), config_.light, clock, exchange_),
      depth_capacity_(exchange_.slot.back().depth_um.capacity()),
      rules_(config_.reconstruction) {
  std::unique_ptr<ActiveCalibration> active;
  bool unusable = false;
  if (calibration) {
    try {
      active = activate(calibration, info_, rules_);
      active->generation = ++generations_;
      exchange_.generation = generations_;
      calibrations_.push_back({generations_, calibration, 0});
    } catch (const std::invalid_argument& e) {
      const recon::RectifyTable& table = calibration->model->rectify;
      unusable = table.frame_width != info_.width || table.frame_height != info_.height;
      restore_failure_ = e.what();
    }
  }
  loop_ = std::make_unique<CaptureLoop>(CaptureParts{*camera_, light_, exchange_, clock_}, config_,
                                        std::move(active), unusable);
  if (!calibrations_.empty()) {
    try {
      loop_->untouched().restore(*calibration);
    } catch (const std::exception& e) {
      restore_failure_ = e.what();  // the calibration's own reference does instead
    }
  }
}

DepthFrame Pipeline::prototype(const calibration::Calibration* calibration) const {
  DepthFrame frame;
  std::size_t map = pixels(info_.width, info_.height);
  if (calibration != nullptr) {
    const recon::RectifyTable& table = calibration->model->rectify;
    map = std::max(map, pixels(table.width, table.height));
  }
  // Sized, not only reserved: copies keep the size, and its pages are touched now.
  frame.depth_um.resize(map);
  // Any map up to so many rows takes its marks in here.
  constexpr int kMostRows = 4096;
  frame.drawn.tiles.resize(kMostRows / recon::TileGrid::kRows);
  frame.luma.resize(pixels(info_.width, info_.height));
  // As much as YUYV, which is what drivers make room for themselves (uvcvideo: the camera's
  // dwMaxVideoFrameSize).
  frame.jpeg.resize(2 * pixels(info_.width, info_.height));
  return frame;
}

void Pipeline::start() {
  if (config_.lock_memory) {
    if (auto refused = base::lock_memory()) realtime_.push_back(std::move(*refused));
  }
  light_.start();
  camera_->start();
  compare_camera();
  loop_->untouched().start();
  capture_ = base::RtThread(
      {.name = "dtact-capture", .cpu = config_.cpu, .fifo_priority = config_.fifo_priority},
      [this] { loop_->run(); });
  cpu_ = capture_.cpu();
  for (const std::string& refused : capture_.refused()) {
    realtime_.push_back(refused);
    if (refused.find("SCHED_FIFO") != std::string::npos) exchange_.not_realtime = true;
  }
}

void Pipeline::stop() noexcept {
  exchange_.stop = true;
  capture_.join();
  light_.stop();
  loop_->untouched().stop();
}

std::optional<Event> Pipeline::next_event() {
  free_retired();
  if (exchange_.camera_returned.exchange(false, std::memory_order_acquire)) compare_camera();
  if (!own_events_.empty()) {
    Event event = std::move(own_events_.front());
    own_events_.pop_front();
    return event;
  }
  Event event;
  if (light_.next_event(event)) return event;
  Report report;
  if (!exchange_.reports.pop(report)) return std::nullopt;
  if (const auto* answer = std::get_if<Answer>(&report)) {
    CommandDone done{answer->ticket, answer->outcome, answer->sentence, answer->at};
    const auto copy = copies_.extract(answer->ticket);
    if (copy && done.outcome == Outcome::done) done.reference = copy.mapped();
    return done;
  }
  if (const auto* contact = std::get_if<ContactChanged>(&report)) return *contact;
  if (const auto* reference = std::get_if<ReferenceTaken>(&report)) return *reference;
  return std::get<StateChanged>(report);
}

bool Pipeline::submit(Command command) {
  free_retired();
  if (const auto* light = std::get_if<SetLight>(&command.what)) {
    return light_.submit(command.ticket, light->light);
  }
  if (const auto* rezero = std::get_if<Rezero>(&command.what)) {
    return exchange_.orders.push(RezeroOrder{command.ticket, rezero->force});
  }
  if (std::holds_alternative<CopyReference>(command.what)) return copy_reference(command.ticket);
  if (const auto* how = std::get_if<SetReconstruction>(&command.what)) {
    return reconstruct(command.ticket, how->rules);
  }
  return use(command.ticket, std::get<UseCalibration>(command.what));
}

bool Pipeline::copy_reference(std::uint64_t ticket) {
  if (exchange_.orders.room() == 0) return false;
  // Made and freed on this side; the capture thread only writes into it.
  auto copy = std::make_shared<ReferenceCopy>();
  copy->width = info_.width;
  copy->height = info_.height;
  copy->image_q8.resize(pixels(info_.width, info_.height));
  (void)exchange_.orders.push(ReferenceOrder{ticket, copy.get()});  // room was made sure of
  copies_.emplace(ticket, std::move(copy));
  return true;
}

bool Pipeline::use(std::uint64_t ticket, const UseCalibration& command) {
  if (exchange_.orders.room() == 0) return false;
  try {
    if (!command.calibration) throw std::invalid_argument("no calibration was given");
    if (!order(ticket, {0, command.calibration, command.key}, rules_, false)) return false;
    restore_failure_.clear();  // of the calibration before
    return true;
  } catch (const std::invalid_argument& e) {
    return refuse(ticket, e.what());
  }
}

bool Pipeline::reconstruct(std::uint64_t ticket, const ReconstructionRules& rules) {
  if (exchange_.orders.room() == 0) return false;
  if (calibrations_.empty()) {
    rules_ = rules;
    const Stamp now{exchange_.sequence.load(std::memory_order_relaxed), clock_.monotonic_ns(),
                    clock_.wall_ns()};
    own_events_.emplace_back(CommandDone{ticket, Outcome::done, "", now});
    exchange_.wake.signal();
    return true;
  }
  try {
    const Known same = calibrations_.back();
    if (!order(ticket, same, rules, true)) return false;
    rules_ = rules;
    return true;
  } catch (const std::invalid_argument& e) {
    return refuse(ticket, e.what());
  }
}

bool Pipeline::order(std::uint64_t ticket, const Known& next, const ReconstructionRules& rules,
                     bool same_image) {
  // First: that it is for other frames says more than that it has no room.
  auto active = activate(next.calibration, camera_->info(), rules);
  const recon::RectifyTable& table = next.calibration->model->rectify;
  if (pixels(table.width, table.height) > depth_capacity_) {
    throw std::invalid_argument(
        fmt::format("a depth map of {}x{} pixels needs more memory than was taken at start: "
                    "restart dtactd with this calibration",
                    table.width, table.height));
  }
  active->generation = ++generations_;
  active->key = next.key;
  calibrations_.push_back({generations_, next.calibration, next.key});
  return exchange_.orders.push(CalibrationOrder{ticket, std::move(active), same_image});
}

bool Pipeline::refuse(std::uint64_t ticket, const char* sentence) {
  own_events_.emplace_back(CommandDone{ticket, Outcome::invalid, sentence});
  exchange_.wake.signal();
  return true;
}

// A camera may come up after the daemon, or as another one after a plug.
void Pipeline::compare_camera() {
  if (calibrations_.empty()) return;
  exchange_.camera_mismatch.store(
      camera_differs(*calibrations_.back().calibration, camera_->info()),
      std::memory_order_relaxed);
}

void Pipeline::free_retired() {
  std::unique_ptr<ActiveCalibration> old;
  while (exchange_.retired.pop(old)) old.reset();
  const std::uint64_t in_use = exchange_.generation.load(std::memory_order_acquire);
  while (!calibrations_.empty() && calibrations_.front().generation < in_use) {
    calibrations_.pop_front();
  }
}

void Pipeline::want(Wanted wanted) noexcept {
  exchange_.want_contact.store(wanted.contact || wanted.depth, std::memory_order_relaxed);
  exchange_.want_depth.store(wanted.depth, std::memory_order_relaxed);
  exchange_.want_luma.store(wanted.luma, std::memory_order_relaxed);
  exchange_.want_jpeg.store(wanted.jpeg, std::memory_order_relaxed);
}

Status Pipeline::status() const {
  Status status;
  status.state = exchange_.state.load(std::memory_order_relaxed);
  status.health = health_of(exchange_.health.load(std::memory_order_relaxed));
  status.camera = camera_->info();
  status.camera_report = camera_->report();
  status.camera_damaged = exchange_.camera_damaged.load(std::memory_order_relaxed);
  status.ring = light_.info();
  status.ring_message = light_.message();
  status.light = light_.light();
  status.light_since_ns = light_.light_since_ns();
  const std::uint64_t in_use = exchange_.generation.load(std::memory_order_acquire);
  for (const Known& known : calibrations_) {
    if (known.generation == in_use) status.calibration = known.calibration;
  }
  status.reconstruction = rules_;
  status.frames = exchange_.frames.load(std::memory_order_relaxed);
  status.skipped = exchange_.slot.replaced();
  status.fps = exchange_.statistics.fps(clock_.monotonic_ns());
  status.camera_fps = exchange_.camera_fps.load(std::memory_order_relaxed);
  // The picture may settle for patience_frames and be averaged for as long again; without frames
  // the re-zero is refused after a second.
  const double fps =
      status.camera_fps > 0 ? std::min(status.camera_fps, status.camera.fps) : status.camera.fps;
  status.rezero_within_s = 1 + 2 * config_.reference.patience_frames / fps;
  status.realtime = realtime_;
  status.cpu = cpu_;
  status.stages = exchange_.statistics.stages();
  status.capture_thread = exchange_.statistics.usage();
  status.light_followed = exchange_.light_followed.load(std::memory_order_relaxed);
  status.place_message = loop_->untouched().place_message();
  status.storage_message = loop_->untouched().storage_message();
  if (status.storage_message.empty() && !loop_->untouched().has_written()) {
    status.storage_message = restore_failure_;
  }
  return status;
}

}  // namespace dtact::pipeline
