#include "hal/libcamera/session.hpp"

#include <fmt/format.h>
#include <libcamera/base/object.h>
#include <libcamera/control_ids.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <iterator>
#include <system_error>
#include <thread>
#include <utility>

#include "hal/base/clock.hpp"
#include "hal/base/device_allow.hpp"
#include "hal/libcamera/sensor_mode.hpp"
#include "hal/libcamera/skip_frames.hpp"
#include "hal/live/source.hpp"

namespace dtact::hal::libcamera_backend {
namespace {

namespace lc = libcamera;
using live::DeviceError;

[[noreturn]] void fail(int result, const char* what, const std::string& id) {
  const int error = result < 0 ? -result : result;
  if (error == EBUSY) {
    throw DeviceError(CameraState::busy, fmt::format("another program uses {}: end it", id));
  }
  if (error == EPERM) {
    throw DeviceError(CameraState::denied,
                      fmt::format("no permission to use {}: {}", id, base::kDeviceAllowFix));
  }
  if (error == EACCES) {
    throw DeviceError(CameraState::denied,
                      fmt::format("no permission to use {}: add the daemon's user to the group "
                                  "video (usermod -aG video USER) and start it again",
                                  id));
  }
  throw DeviceError(
      CameraState::unplugged,
      fmt::format("cannot {} {} ({}): plug the camera in again", what, id, std::strerror(error)));
}

std::size_t page_bytes(std::size_t n) {
  const auto page = static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
  return (n + page - 1) / page * page;
}

/// The EXIF orientation of the pictures as they will come: 1 = upright.
template <class Configuration>
int orientation_of(const Configuration& configuration) {
  if constexpr (requires { configuration.orientation; }) {
    return static_cast<int>(configuration.orientation);
  } else {
    // Before 0.1 a transform, of which sensors have flips alone: none, left-right, top-bottom,
    // both.
    constexpr std::array kExif{1, 2, 4, 3};
    return kExif.at(static_cast<std::size_t>(configuration.transform));
  }
}

/// Opening may be the capture thread's work, for which the watchdog waits ten seconds. The two
/// limits add up when a camera that is opened anew is changed as the one before was.
constexpr double kMaxSettlingNs = 4e9;
constexpr double kMaxChangingNs = 2e9;

/// One that does nothing, on the thread that it has been moved to.
class Last : public lc::Object {
 public:
  void done() {}
};

/// Returns when libcamera's thread has finished all earlier calls.
void wait_for(lc::Thread* thread) {
  auto last = std::make_unique<Last>();
  last->moveToThread(thread);
  last->invokeMethod(&Last::done, lc::ConnectionTypeBlocking);
  last.release()->deleteLater();
}

/// The verdict on the pipeline's result of configure().
ControlVerdict granted(bool as_asked) {
  return as_asked ? ControlVerdict::confirmed : ControlVerdict::refused;
}

}  // namespace

Session::Session(std::unique_ptr<Manager> manager, std::shared_ptr<lc::Camera> camera,
                 const CameraConfig& config, const PhotometricLock& lock, const DmaHeap* heap)
    : manager_(std::move(manager)),
      camera_(std::move(camera)),
      sensor_(sensor_of(camera_->properties())),
      fps_(config.fps) {
  if (const int e = camera_->acquire(); e != 0) fail(e, "acquire", camera_->id());
  acquired_ = true;
  try {
    configure(config);
    make_requests(heap);
    start(lock);
    settle();
    settings_ = lock.settings(camera_->controls(), controls_);
  } catch (...) {
    stop();
    throw;
  }
}

Session::~Session() { stop(); }

void Session::configure(const CameraConfig& config) {
  // The role of a stream that goes on at a rate, from the image processor where there is one. A
  // mono sensor's own format is asked for on top of it: the role for raw streams is refused by
  // pipelines that have no sensor (virtual.cpp: generateConfiguration()), and its list of formats
  // leaves out what the image processor makes.
  configuration_ = camera_->generateConfiguration({lc::StreamRole::VideoRecording});
  if (!configuration_ || configuration_->empty()) {
    throw live::ModeError(
        fmt::format("libcamera has no video of {}: it lacks what this board's image processor "
                    "needs; use a newer libcamera, or a USB camera",
                    camera_->id()));
  }
  const auto configure = [&] {
    const Choice choice = choose_format(*configuration_, config, sensor_, camera_->id());
    if (const int e = camera_->configure(configuration_.get()); e != 0) {
      fail(e, "configure", camera_->id());
    }
    return choice;
  };
  Choice choice = configure();
  const double fastest = fastest_rate(camera_->controls());
  if (!keeps_rate(fastest, config.fps)) {
    const std::vector<SensorMode> modes = list_sensor_modes(*camera_, *configuration_);
    const std::optional<SensorMode> mode = choose_sensor_mode(modes, config);
    if (!mode) throw live::ModeError(too_slow(camera_->id(), fastest, modes, config));
    set_sensor_mode(*configuration_, *mode);
    choice = configure();
    controls_.push_back({"sensor_height", mode->height, ControlVerdict::confirmed,
                         fmt::format("the sensor's mode {}x{} with {} bits, which keeps the rate",
                                     mode->width, mode->height, mode->bit_depth)});
  }
  format_ = format_of(configuration_->at(0), choice);
  format_.zero_copy = true;
  pixel_format_ = choice.name;
  note_pictures(choice);
}

void Session::note_pictures(const Choice& choice) {
  if (choice.encoding != live::Encoding::jpeg) {
    controls_.push_back({"full_range", format_.full_range ? 1 : 0, granted(format_.full_range),
                         format_.full_range ? ""
                                            : "the camera gives luma from 16 to 235: it is "
                                              "stretched, and has 220 grey levels"});
  }
  const int orientation = orientation_of(*configuration_);
  controls_.push_back({"orientation", orientation, granted(orientation == 1),
                       orientation == 1 ? ""
                                        : "the pictures come turned (a number as in EXIF): the "
                                          "camera cannot turn them as it is mounted"});
}

void Session::make_requests(const DmaHeap* heap) {
  if (heap != nullptr) own_buffers_ = make_frame_buffers(*heap, configuration_->at(0));
  for (const auto& buffer : own_buffers_) add_slot(*buffer);
  if (!own_buffers_.empty()) return;
  // Without caches it is to be read once only.
  if (!driver_memory_is_cached(sensor_)) format_.zero_copy = false;
  lc::Stream* stream = configuration_->at(0).stream();
  allocator_ = std::make_unique<lc::FrameBufferAllocator>(camera_);
  if (const int n = allocator_->allocate(stream); n < 2) {
    fail(n < 0 ? n : ENOMEM, "get buffers of", camera_->id());
  }
  for (const auto& buffer : allocator_->buffers(stream)) add_slot(*buffer);
}

void Session::add_slot(lc::FrameBuffer& buffer) {
  if (slots_.size() == completed_.size()) return;
  Slot slot;
  slot.request = camera_->createRequest(slots_.size());
  if (!slot.request || slot.request->addBuffer(configuration_->at(0).stream(), &buffer) != 0) {
    fail(ENOMEM, "make requests of", camera_->id());
  }
  const lc::FrameBuffer::Plane& luma = buffer.planes().front();
  std::size_t end = 0;  // planes of one descriptor lie one after the other
  for (const lc::FrameBuffer::Plane& plane : buffer.planes()) {
    if (plane.fd.get() == luma.fd.get()) {
      end = std::max<std::size_t>(end, std::size_t{plane.offset} + plane.length);
    }
  }
  try {
    slot.mapping = Mapping(luma.fd.get(), end);
  } catch (const std::system_error& e) {
    fail(e.code().value(), "map buffers of", camera_->id());
  }
  slot.buffer = &buffer;
  slot.fd = luma.fd.get();
  slot.offset = luma.offset;
  slot.length = luma.length;
  // The last page is there as a whole, and may be read beyond the buffer's end.
  const std::size_t image =
      static_cast<std::size_t>(format_.bytes_per_line) * static_cast<std::size_t>(format_.height);
  if (slot.offset + image + kLumaPadding > page_bytes(end)) format_.zero_copy = false;
  slots_.push_back(std::move(slot));
}

void Session::start(const PhotometricLock& lock) {
  camera_->requestCompleted.connect(this, &Session::on_completed);
  camera_->disconnected.connect(this, &Session::on_disconnected);
  PhotometricLock::RequestedControls requested_controls =
      lock.requested_controls(camera_->controls());
  std::ranges::move(requested_controls.controls, std::back_inserter(controls_));
  if (const int e = camera_->start(&requested_controls.list); e != 0)
    fail(e, "start", camera_->id());
  for (Slot& slot : slots_) {
    // Some pipelines look at a request's controls only, not at those of the start.
    slot.request->controls().merge(requested_controls.list);
    if (const int e = camera_->queueRequest(slot.request.get()); e != 0) {
      fail(e, "queue requests of", camera_->id());
    }
    ++queued_;
  }
}

void Session::settle() {
  // Now, since the controls are compared with a calibration's, which has what became of them, when
  // the camera has been opened, and only then.
  (void)skip_frames(*this, kSettlingFrames, settling_deadline_ns(kMaxSettlingNs),
                    [this] { return exchange_.has_readings(); });
  (void)exchange_.compare(controls_);
}

std::int64_t Session::settling_deadline_ns(double max_ns) const noexcept {
  const double ns = std::min(max_ns, 1e9 + kSettlingFrames * 1e9 / fps_);
  return base::system_clock().monotonic_ns() + static_cast<std::int64_t>(ns);
}

void Session::stop() noexcept {
  if (!std::exchange(acquired_, false)) return;
  // Requests under way come back cancelled from within stop(); they must still be there. When the
  // camera was unplugged it returns at once, and libcamera's thread may still have a request before
  // it that was queued just then.
  camera_->stop();
  wait_for(camera_->thread());
  camera_->requestCompleted.disconnect(this);
  camera_->disconnected.disconnect(this);
  for (Slot& slot : slots_) slot.request.reset();
  allocator_.reset();
  camera_->release();
  camera_.reset();
  manager_.reset();
}

// On libcamera's thread.
void Session::on_completed(lc::Request* request) {
  if (request->status() == lc::Request::RequestCancelled) return;
  const std::lock_guard guard(mutex_);
  completed_[completed_count_++] = static_cast<int>(request->cookie());
  changed_.notify_one();
}

// On libcamera's thread.
void Session::on_disconnected() {
  const std::lock_guard guard(mutex_);
  gone_ = true;
  changed_.notify_one();
}

void Session::wait(std::int64_t deadline_ns) noexcept {
  // steady_clock is CLOCK_MONOTONIC.
  const std::chrono::steady_clock::time_point deadline{std::chrono::nanoseconds(deadline_ns)};
  std::unique_lock guard(mutex_);
  changed_.wait_until(guard, deadline, [this] { return completed_count_ > 0 || gone_; });
}

live::DequeueStatus Session::dequeue(live::FilledBuffer& out) noexcept {
  {
    const std::lock_guard guard(mutex_);
    if (gone_ || !acquired_) return live::DequeueStatus::failed;
    if (completed_count_ == 0) return live::DequeueStatus::none;
    out.index = completed_[0];
    std::shift_left(completed_.begin(), completed_.begin() + completed_count_, 1);
    --completed_count_;
  }
  --queued_;

  const Slot& slot = slots_[static_cast<std::size_t>(out.index)];
  const bool readable = sync_for_reading(slot.fd, true);
  const lc::FrameMetadata& metadata = slot.buffer->metadata();
  const std::size_t used = metadata.planes().empty() ? 0 : metadata.planes()[0].bytesused;
  // The virtual camera of libcamera 0.4.0 fills the buffer and says nothing of it.
  const bool silent = used == 0 && metadata.timestamp == 0;
  out.payload =
      slot.mapping.bytes().subspan(slot.offset, silent ? slot.length : std::min(used, slot.length));
  out.sequence = metadata.sequence;
  out.flagged = !readable || metadata.status != lc::FrameMetadata::FrameSuccess;
  const std::int64_t now = base::system_clock().monotonic_ns();
  const auto stamp = static_cast<std::int64_t>(metadata.timestamp);
  const auto exposed = slot.request->metadata().get(lc::controls::SensorTimestamp);
  constexpr std::int64_t kPlausible = 1'000'000'000;
  out.timestamp_ns = now;
  out.meaning = TimestampMeaning::arrival;
  if (exposed && *exposed <= now && *exposed > now - kPlausible) {
    out.timestamp_ns = *exposed;
    // libcamera calls it the first row's exposure; its pipelines put in the driver's stamp of the
    // buffer, which a frame's first data gets (unicam: frame start; uvcvideo: first packet).
    out.meaning = TimestampMeaning::first_packet;
  } else if (stamp <= now && stamp > now - kPlausible) {
    out.timestamp_ns = stamp;
    out.meaning = TimestampMeaning::end_of_frame;
  }
  exchange_.read(slot.request->metadata());
  return live::DequeueStatus::filled;
}

bool Session::enqueue(int index) noexcept {
  if (!acquired_) return false;
  const Slot& slot = slots_[static_cast<std::size_t>(index)];
  (void)sync_for_reading(slot.fd, false);
  slot.request->reuse(lc::Request::ReuseBuffers);
  exchange_.add_changes(slot.request->controls());
  const bool taken = camera_->queueRequest(slot.request.get()) == 0;
  if (taken) ++queued_;
  return taken;
}

std::string Session::check_controls(std::vector<CameraControl>& controls) {
  return exchange_.compare(controls);
}

void Session::change(const CameraChange& change, std::vector<CameraControl>& controls,
                     CameraSettings& settings) {
  exchange_.change(change, controls);
  // The frames say what has become of it, once those that were under way have passed.
  const std::int64_t deadline_ns = settling_deadline_ns(kMaxSettlingNs);
  while (!exchange_.settled() && base::system_clock().monotonic_ns() < deadline_ns) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  (void)exchange_.compare(controls);
  PhotometricLock::read_back(controls, settings);
}

void Session::change_before_use(const CameraChange& change, std::vector<CameraControl>& controls,
                                CameraSettings& settings) {
  exchange_.change(change, controls);
  // A request carries the change, so frames must be taken: one to have a request, and those that
  // settle. The first one that is used then has the change.
  (void)skip_frames(*this, 1 + kSettlingFrames, settling_deadline_ns(kMaxChangingNs),
                    [] { return true; });
  (void)exchange_.compare(controls);
  PhotometricLock::read_back(controls, settings);
}

}  // namespace dtact::hal::libcamera_backend
