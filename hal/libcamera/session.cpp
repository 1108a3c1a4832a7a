#include "hal/libcamera/session.hpp"

#include <fmt/format.h>
#include <libcamera/control_ids.h>
#include <linux/dma-buf.h>
#include <sys/ioctl.h>
#include <sys/mman.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <utility>

#include "hal/base/clock.hpp"
#include "hal/libcamera/formats.hpp"
#include "hal/live/device_error.hpp"

namespace dtact::hal::libcamera_backend {
namespace {

namespace lc = libcamera;
using live::DeviceError;

[[noreturn]] void fail(int result, const char* what, const std::string& id) {
  const int error = result < 0 ? -result : result;
  if (error == EBUSY) {
    throw DeviceError(CameraState::busy, fmt::format("another program uses {}: end it", id));
  }
  if (error == EACCES || error == EPERM) {
    throw DeviceError(CameraState::denied,
                      fmt::format("no permission to use {}: add the daemon's user to the group "
                                  "video (usermod -aG video USER) and start it again",
                                  id));
  }
  throw DeviceError(
      CameraState::unplugged,
      fmt::format("cannot {} {} ({}): plug the camera in again", what, id, std::strerror(error)));
}

/// Caches are told that the processor reads (begin) or has read (end) a buffer that the camera
/// writes. Exporters without caches to keep refuse, and nothing is lost by it.
void sync_for_reading(int fd, bool begin) noexcept {
  dma_buf_sync sync{};
  sync.flags = DMA_BUF_SYNC_READ | (begin ? DMA_BUF_SYNC_START : DMA_BUF_SYNC_END);
  (void)::ioctl(fd, DMA_BUF_IOCTL_SYNC, &sync);
}

std::size_t page_bytes(std::size_t n) {
  const auto page = static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
  return (n + page - 1) / page * page;
}

}  // namespace

Session::Session(std::shared_ptr<lc::Camera> camera, const CameraConfig& config,
                 const PhotometricLock& lock)
    : camera_(std::move(camera)) {
  if (const int e = camera_->acquire(); e != 0) fail(e, "acquire", camera_->id());
  acquired_ = true;
  try {
    configuration_ = camera_->generateConfiguration({lc::StreamRole::VideoRecording});
    if (!configuration_ || configuration_->empty()) fail(ENODEV, "configure", camera_->id());
    const Choice choice = choose_format(*configuration_, config, camera_->id());
    if (const int e = camera_->configure(configuration_.get()); e != 0) {
      fail(e, "configure", camera_->id());
    }
    format_ = format_of(configuration_->at(0), choice);
    pixel_format_ = choice.name;
    make_requests();
    start(lock);
  } catch (...) {
    stop();
    for (const Slot& slot : slots_) {
      ::munmap(const_cast<std::uint8_t*>(slot.mapping.data()), slot.mapping.size());
    }
    throw;
  }
}

Session::~Session() {
  stop();
  for (const Slot& slot : slots_) {
    ::munmap(const_cast<std::uint8_t*>(slot.mapping.data()), slot.mapping.size());
  }
}

void Session::make_requests() {
  lc::Stream* stream = configuration_->at(0).stream();
  allocator_ = std::make_unique<lc::FrameBufferAllocator>(camera_);
  if (const int n = allocator_->allocate(stream); n < 2) {
    fail(n < 0 ? n : ENOMEM, "get buffers of", camera_->id());
  }
  format_.lendable = true;
  for (const auto& buffer : allocator_->buffers(stream)) {
    if (slots_.size() == completed_.size()) break;
    Slot slot;
    slot.request = camera_->createRequest(slots_.size());
    if (!slot.request || slot.request->addBuffer(stream, buffer.get()) != 0) {
      fail(ENOMEM, "make requests of", camera_->id());
    }
    const lc::FrameBuffer::Plane& luma = buffer->planes().front();
    std::size_t end = 0;  // planes of one descriptor lie one after the other
    for (const lc::FrameBuffer::Plane& plane : buffer->planes()) {
      if (plane.fd.get() == luma.fd.get()) {
        end = std::max<std::size_t>(end, std::size_t{plane.offset} + plane.length);
      }
    }
    void* memory = ::mmap(nullptr, end, PROT_READ, MAP_SHARED, luma.fd.get(), 0);
    if (memory == MAP_FAILED) fail(errno, "map buffers of", camera_->id());
    slot.buffer = buffer.get();
    slot.fd = luma.fd.get();
    slot.mapping = {static_cast<const std::uint8_t*>(memory), end};
    slot.offset = luma.offset;
    slot.length = luma.length;
    // The last page is there as a whole, and may be read beyond the buffer's end.
    const std::size_t image =
        static_cast<std::size_t>(format_.bytes_per_line) * static_cast<std::size_t>(format_.height);
    if (slot.offset + image + kLumaPadding > page_bytes(end)) format_.lendable = false;
    slots_.push_back(std::move(slot));
  }
}

void Session::start(const PhotometricLock& lock) {
  camera_->requestCompleted.connect(this, &Session::on_completed);
  camera_->disconnected.connect(this, &Session::on_disconnected);
  PhotometricLock::Wishes wishes = lock.wishes(camera_->controls());
  controls_ = std::move(wishes.controls);
  if (const int e = camera_->start(&wishes.list); e != 0) fail(e, "start", camera_->id());
  for (Slot& slot : slots_) {
    // Some pipelines look at a request's controls only, not at those of the start.
    slot.request->controls().merge(wishes.list);
    if (const int e = camera_->queueRequest(slot.request.get()); e != 0) {
      fail(e, "queue requests of", camera_->id());
    }
  }
}

void Session::stop() noexcept {
  if (!std::exchange(acquired_, false)) return;
  // Requests under way come back cancelled from within stop(); they must still be there.
  camera_->stop();
  camera_->requestCompleted.disconnect(this);
  camera_->disconnected.disconnect(this);
  if (!gone()) {
    for (Slot& slot : slots_) slot.request.reset();
    allocator_.reset();
  }
  camera_->release();
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

bool Session::gone() noexcept {
  const std::lock_guard guard(mutex_);
  return gone_;
}

void Session::wait(std::int64_t deadline_ns) noexcept {
  // steady_clock is CLOCK_MONOTONIC.
  const std::chrono::steady_clock::time_point deadline{std::chrono::nanoseconds(deadline_ns)};
  std::unique_lock guard(mutex_);
  changed_.wait_until(guard, deadline, [this] { return completed_count_ > 0 || gone_; });
}

live::DequeueStatus Session::dequeue(live::Filled& out) noexcept {
  const std::lock_guard guard(mutex_);
  if (gone_ || !acquired_) return live::DequeueStatus::failed;
  if (completed_count_ == 0) return live::DequeueStatus::none;
  out.index = completed_[0];
  std::shift_left(completed_.begin(), completed_.begin() + completed_count_, 1);
  --completed_count_;

  const Slot& slot = slots_[static_cast<std::size_t>(out.index)];
  sync_for_reading(slot.fd, true);
  const lc::FrameMetadata& metadata = slot.buffer->metadata();
  const std::size_t used = metadata.planes().empty() ? 0 : metadata.planes()[0].bytesused;
  out.payload = slot.mapping.subspan(slot.offset, std::min(used, slot.length));
  out.sequence = metadata.sequence;
  out.flagged = metadata.status != lc::FrameMetadata::FrameSuccess;
  const std::int64_t now = base::system_clock().monotonic_ns();
  const auto stamp = static_cast<std::int64_t>(metadata.timestamp);
  const auto exposed = slot.request->metadata().get(lc::controls::SensorTimestamp);
  constexpr std::int64_t kPlausible = 1'000'000'000;
  out.timestamp_ns = now;
  out.meaning = TimestampMeaning::arrival;
  if (exposed && *exposed <= now && *exposed > now - kPlausible) {
    out.timestamp_ns = *exposed;
    out.meaning = TimestampMeaning::start_of_exposure;
  } else if (stamp <= now && stamp > now - kPlausible) {
    out.timestamp_ns = stamp;
    out.meaning = TimestampMeaning::end_of_frame;
  }
  try {
    PhotometricLock::read(slot.request->metadata(), readings_);
  } catch (const std::exception&) {
    readings_.clear();  // no memory for them: the next frame tries again
  }
  return live::DequeueStatus::filled;
}

bool Session::enqueue(int index) noexcept {
  if (!acquired_) return false;
  const Slot& slot = slots_[static_cast<std::size_t>(index)];
  sync_for_reading(slot.fd, false);
  slot.request->reuse(lc::Request::ReuseBuffers);
  return camera_->queueRequest(slot.request.get()) == 0;
}

std::string Session::check_controls(std::vector<CameraControl>& controls) {
  Readings readings;
  {
    const std::lock_guard guard(mutex_);
    readings = readings_;
  }
  return PhotometricLock::compare(readings, controls);
}

}  // namespace dtact::hal::libcamera_backend
