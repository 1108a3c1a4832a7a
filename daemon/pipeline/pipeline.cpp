#include "daemon/pipeline/pipeline.hpp"

#include <fmt/format.h>

#include <exception>
#include <stdexcept>
#include <utility>

namespace dtact::pipeline {

void check_camera(const hal::CameraInfo& info) {
  if (info.width < kMinFrameWidth || info.height < kMinFrameHeight) {
    throw std::invalid_argument(
        fmt::format("camera {} delivers {}x{} pixels; at least {}x{} are needed: choose another "
                    "camera.width and camera.height{}",
                    info.identity, info.width, info.height, kMinFrameWidth, kMinFrameHeight,
                    info.decode_scale == 1 ? "" : ", or a smaller camera.decode_scale"));
  }
  if (!(info.fps > 0)) {
    throw std::invalid_argument(
        fmt::format("camera {} states no frame rate: set camera.fps above 0", info.identity));
  }
}

namespace {

hal::CameraInfo checked(hal::CameraInfo info) {
  check_camera(info);
  return info;
}

HealthSet health_of(std::uint32_t bits) noexcept {
  HealthSet set;
  for (int i = 0; i < kHealthCount; ++i) {
    if ((bits >> static_cast<unsigned>(i) & 1U) != 0) set.set(static_cast<Health>(i));
  }
  return set;
}

/// What happened, and the fix.
const char* sentence(Outcome outcome) noexcept {
  switch (outcome) {
    case Outcome::refused_contact:
      return "there is contact: lift the object and ask again, or force it";
    case Outcome::refused_unsteady:
      return "the image does not hold still: lift the object and ask again, or force it";
    case Outcome::refused_dark:
      return "the image is too dark to be a reference: make the light brighter";
    case Outcome::uncalibrated:
      return "there is no calibration, so there is no reference: make one with dtact-calibrate "
             "depth and send it with dtactctl calibration upload";
    case Outcome::no_reference:
      return "the reference is being taken: ask again when the state is serving";
    case Outcome::camera_away:
      return "the camera delivers no frames: see the camera in the status";
    case Outcome::done:
    case Outcome::device_error:  // The ring says what is wrong with it.
    case Outcome::ring_away:
      break;
  }
  return "";
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
      light_(std::move(ring), config_.light, clock, exchange_, camera_.get()),
      depth_capacity_(exchange_.slot.back().depth_um.capacity()),
      rules_(config_.reconstruction) {
  std::unique_ptr<ActiveCalibration> active;
  bool unusable = false;
  if (calibration) {
    try {
      active = activate(calibration, info_, rules_);
      calibration_ = active->image.calibration;
    } catch (const std::invalid_argument& e) {
      unusable = !fits(*calibration, info_);
      restore_failure_ = e.what();
    }
  }
  loop_ = std::make_unique<CaptureLoop>(CaptureParts{*camera_, light_, exchange_, clock_}, config_,
                                        std::move(active), unusable);
  if (calibration_) {
    try {
      loop_->tracker().restore(*calibration_);
    } catch (const std::exception& e) {
      restore_failure_ = e.what();  // the calibration's own reference does instead
    }
  }
}

DepthFrame Pipeline::prototype(const calibration::Calibration* calibration) const {
  DepthFrame frame;
  const int scale = info_.decode_scale;
  std::size_t map = pixels(info_.width, info_.height);
  if (calibration != nullptr) {
    const recon::RectifyTable& table = calibration->model->rectify;
    const int to = table.frame_width == info_.width ? 1 : scale;
    map = std::max(map, pixels(table.width / to, table.height / to));
  }
  // Sized, not only reserved: copies keep the size, and the pages are mapped now.
  frame.depth_um.resize(map);
  // Maps of up to this number of rows record their tiles here.
  constexpr int kMaxRows = 8192;
  frame.drawn.tiles.resize(kMaxRows / recon::TileGrid::kRows);
  frame.luma.resize(pixels(info_.width, info_.height));
  // The size of YUYV, for which drivers make room themselves (uvcvideo: the camera's
  // dwMaxVideoFrameSize).
  frame.jpeg.resize(2 * pixels(info_.width * scale, info_.height * scale));
  return frame;
}

void Pipeline::start() {
  if (config_.lock_memory) {
    if (auto refused = base::lock_memory()) realtime_.push_back(std::move(*refused));
  }
  light_.start();
  camera_->start();
  compare_camera();
  loop_->tracker().start();
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
  // Dark at once: what follows may take longer than a service manager waits. The capture loop ends
  // with the frame it is at, so no reference is taken in the dark.
  light_.stop();
  capture_.join();
  loop_->tracker().stop();
}

std::optional<Event> Pipeline::next_event() {
  if (exchange_.camera_returned.exchange(false, std::memory_order_acquire)) compare_camera();
  Event event;
  if (!light_.next_event(event) && !exchange_.events.pop(event)) return std::nullopt;
  if (auto* done = std::get_if<CommandDone>(&event)) finish(*done);
  return event;
}

void Pipeline::finish(CommandDone& done) {
  if (done.message.empty()) done.message = sentence(done.outcome);
  if (done.outcome != Outcome::done) return;
  if (const auto* use = std::get_if<UseCalibration>(&done.command.what)) {
    calibration_ = use->calibration;
    restore_failure_.clear();  // of the calibration before
    config_.calibration_note.clear();
    compare_camera();
  }
  if (std::holds_alternative<SetCamera>(done.command.what)) compare_camera();
  if (const auto* how = std::get_if<SetReconstruction>(&done.command.what)) rules_ = how->rules;
}

bool Pipeline::submit(Command command) {
  if (std::holds_alternative<SetLight>(command.what) ||
      std::holds_alternative<SetCamera>(command.what)) {
    return light_.submit(std::move(command));
  }
  if (auto* to = std::get_if<CopyReference>(&command.what)) {
    to->copy = std::make_shared<ReferenceCopy>();
    to->copy->width = info_.width;
    to->copy->height = info_.height;
    to->copy->image_q8.resize(pixels(info_.width, info_.height));
  }
  return exchange_.commands.push(std::move(command));
}

UseCalibration Pipeline::prepare(const std::shared_ptr<const calibration::Calibration>& calibration,
                                 const ReconstructionRules& rules) const {
  // First: that it is for other frames says more than that it has no room.
  std::shared_ptr<ActiveCalibration> active = activate(calibration, camera_->info(), rules);
  const auto in_use = active->image.calibration;
  const recon::RectifyTable& table = in_use->model->rectify;
  if (pixels(table.width, table.height) > depth_capacity_) {
    throw std::invalid_argument(
        fmt::format("a depth map of {}x{} pixels needs more memory than was taken at start: "
                    "restart dtactd with this calibration",
                    table.width, table.height));
  }
  return {.calibration = in_use, .prepared = std::move(active)};
}

SetReconstruction Pipeline::prepare_maps(
    const std::shared_ptr<const calibration::Calibration>& in_use,
    const ReconstructionRules& rules) const {
  SetReconstruction command{.rules = rules};
  if (in_use) {
    command.prepared = std::make_shared<Resolutions>(
        in_use->model, recon::CellLattice(in_use->model->rectify), rules);
  }
  return command;
}

// A camera may come up after the daemon, or as another one after a plug.
void Pipeline::compare_camera() {
  if (!calibration_) return;
  exchange_.camera_mismatch.store(camera_differs(*calibration_, camera_->info()),
                                  std::memory_order_relaxed);
}

void Pipeline::want(Wanted wanted) noexcept {
  wanted.contact = wanted.contact || wanted.depth;
  exchange_.wanted.store(wanted, std::memory_order_relaxed);
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
  status.light_requested = light_.requested();
  status.calibration = calibration_;
  status.reconstruction = rules_;
  status.frames = exchange_.frames.load(std::memory_order_relaxed);
  status.skipped = exchange_.slot.replaced();
  status.fps = exchange_.statistics.fps(clock_.monotonic_ns());
  status.camera_fps = exchange_.camera_fps.load(std::memory_order_relaxed);
  status.rezero_timeout_s =
      config_.reference.rezero_timeout_s(status.camera.fps, status.camera_fps);
  status.realtime = realtime_;
  status.cpu = cpu_;
  status.stages = exchange_.statistics.stages();
  status.capture_thread = exchange_.statistics.usage();
  status.light_followed = exchange_.light_followed.load(std::memory_order_relaxed);
  status.camera_shift_message = loop_->tracker().camera_shift_message();
  status.storage_message = loop_->tracker().storage_message();
  if (status.storage_message.empty() && !loop_->tracker().has_written()) {
    status.storage_message = restore_failure_;
  }
  if (!config_.calibration_note.empty()) {
    const std::string separator = status.storage_message.empty() ? "" : " ";
    status.storage_message = config_.calibration_note + separator + status.storage_message;
  }
  return status;
}

}  // namespace dtact::pipeline
