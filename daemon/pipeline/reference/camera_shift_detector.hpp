#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "daemon/pipeline/reference/gel_marks.hpp"
#include "daemon/pipeline/reference/reference_average.hpp"
#include "hal/base/background_thread.hpp"
#include "hal/frame.hpp"

namespace dtact::pipeline {

/// Detects by the gel's marks (gel_marks.hpp) that the camera has moved against the gel since
/// calibration: then depth is right but at the wrong position. Averages frames without
/// contact on the capture thread, once after a new reference and then every kPauseNs, and compares
/// on the side thread, which takes a tenth of a second.
class CameraShiftDetector {
 public:
  /// `frames`: number of frames averaged, as for a reference. `decode_scale`: of the camera's JPEGs
  /// to the frames (hal::CameraInfo); the message counts pixels of the JPEGs.
  CameraShiftDetector(int width, int height, int frames, base::BackgroundThread& thread,
                      int decode_scale = 1);

  // On the capture thread; neither waits nor allocates.

  /// Compares with the marks of another calibration from now on.
  void use_marks(std::shared_ptr<const GelMarks> then) noexcept;
  /// There is a new reference: looks at once.
  void check_now() noexcept;
  /// The next frame. `no_contact`: depth is measured and there is no contact.
  void look(const hal::LumaView& luma, bool no_contact, std::int64_t now_ns) noexcept;
  [[nodiscard]] bool moved() const noexcept {
    return epoch_ != 0 && moved_.load(std::memory_order_acquire) == epoch_;
  }

  // On any thread.

  /// How far the marks have moved; empty before anything was found to have moved.
  [[nodiscard]] std::string message() const;
  /// Waits until what was averaged so far has been judged.
  void settle() const noexcept { compare_.settle(); }

  static constexpr std::int64_t kPauseNs = 20'000'000'000;

 private:
  void judge();
  void compare();

  int width_;
  int decode_scale_;
  ReferenceAverage average_;
  std::shared_ptr<const GelMarks> then_;
  std::uint64_t epoch_ = 0;  // counts calibrations
  std::int64_t due_ns_ = INT64_MIN;

  struct Job {
    std::shared_ptr<const GelMarks> then;
    std::uint64_t epoch = 0;
    std::vector<std::uint16_t> image_q8;
  };
  Job job_;                              // the side thread's while it is busy, else look()'s
  std::atomic<std::uint64_t> moved_{0};  // epoch in which the camera was last found to have moved
  mutable std::mutex mutex_;             // of message_; never taken on the capture thread
  std::string message_;
  base::BackgroundThread::Job compare_;  // last: it uses the others
};

}  // namespace dtact::pipeline
