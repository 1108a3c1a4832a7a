#pragma once

#include <libcamera/camera.h>
#include <libcamera/framebuffer_allocator.h>

#include <array>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "hal/config.hpp"
#include "hal/libcamera/control_exchange.hpp"
#include "hal/libcamera/dma_buffer.hpp"
#include "hal/libcamera/formats.hpp"
#include "hal/libcamera/manager.hpp"
#include "hal/libcamera/photometry.hpp"
#include "hal/live/source.hpp"

namespace dtact::hal::libcamera_backend {

/// A camera that libcamera has given to us and that streams. Requests go round: completed, lent or
/// decoded, queued again, never made anew.
class Session final : public live::Source {
 public:
  /// Configures the camera and starts it, with buffers from `heap` (may be null) where that has
  /// some, else with the driver's own. Throws live::ModeError when it lacks the mode asked for,
  /// live::DeviceError when it is busy or fails.
  /// `manager`: the camera's, null where the caller keeps it for longer.
  Session(std::unique_ptr<Manager> manager, std::shared_ptr<libcamera::Camera> camera,
          const CameraConfig& config, const PhotometricLock& lock, const DmaHeap* heap);
  ~Session() override;

  [[nodiscard]] const std::string& pixel_format() const noexcept { return pixel_format_; }
  [[nodiscard]] const std::vector<CameraControl>& controls() const noexcept { return controls_; }

  [[nodiscard]] live::Format format() const noexcept override { return format_; }
  void wait(std::int64_t deadline_ns) noexcept override;
  [[nodiscard]] live::DequeueStatus dequeue(live::FilledBuffer& out) noexcept override;
  [[nodiscard]] int queued() const noexcept override { return queued_; }
  [[nodiscard]] bool enqueue(int index) noexcept override;
  void stop() noexcept override;
  [[nodiscard]] std::string check_controls(std::vector<CameraControl>& controls) override;
  void change(const CameraChange& change, std::vector<CameraControl>& controls,
              CameraSettings& settings) override;
  void change_before_use(const CameraChange& change, std::vector<CameraControl>& controls,
                         CameraSettings& settings) override;
  [[nodiscard]] const CameraSettings& settings() const noexcept { return settings_; }

 private:
  /// A request for life, with its buffer's memory.
  struct Slot {
    std::unique_ptr<libcamera::Request> request;
    libcamera::FrameBuffer* buffer = nullptr;
    int fd = -1;  ///< The buffer's own.
    Mapping mapping;
    std::size_t offset = 0;  ///< the first plane's, within the mapping
    std::size_t length = 0;  ///< the first plane's
  };

  void configure(const CameraConfig& config);
  /// Adds to the controls what the pictures are like.
  void note_pictures(const Choice& choice);
  void make_requests(const DmaHeap* heap);
  void add_slot(libcamera::FrameBuffer& buffer);
  void start(const PhotometricLock& lock);
  /// Passes over the first frames, and notes in the controls what the last of them says.
  void settle();
  /// Until when to wait for kSettlingFrames, at most `max_ns` from now.
  [[nodiscard]] std::int64_t settling_deadline_ns(double max_ns) const noexcept;
  void on_completed(libcamera::Request* request);
  void on_disconnected();

  std::unique_ptr<Manager> manager_;  // ends after the camera that it gave
  std::shared_ptr<libcamera::Camera> camera_;
  Sensor sensor_;
  std::unique_ptr<libcamera::CameraConfiguration> configuration_;
  std::unique_ptr<libcamera::FrameBufferAllocator> allocator_;
  live::Format format_;
  std::string pixel_format_;
  std::vector<CameraControl> controls_;
  CameraSettings settings_;
  double fps_;
  std::vector<std::unique_ptr<libcamera::FrameBuffer>> own_buffers_;  // those from the heap
  std::vector<Slot> slots_;
  int queued_ = 0;
  bool acquired_ = false;

  // Shared with libcamera's thread; held for copies that do not allocate.
  std::mutex mutex_;
  std::condition_variable changed_;
  std::array<int, 16> completed_{};  // slot indices, oldest first; never more than there are slots
  std::size_t completed_count_ = 0;
  bool gone_ = false;

  ControlExchange exchange_;
};

}  // namespace dtact::hal::libcamera_backend
