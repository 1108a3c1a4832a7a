#pragma once

#include <atomic>
#include <filesystem>
#include <memory>
#include <mutex>
#include <span>
#include <string>

#include "daemon/pipeline/reference/reference_store.hpp"
#include "hal/base/background_thread.hpp"

namespace dtact::pipeline {

/// Writes references to the state folder on the side thread, since a disk may take seconds. It
/// has room for one; while that is being written offer() refuses and the caller offers again.
class ReferenceWriter {
 public:
  /// An empty folder keeps nothing.
  ReferenceWriter(int width, int height, std::filesystem::path folder,
                  base::BackgroundThread& thread);

  /// Capture thread: copies the reference (Q8, frame sized) for writing. False while busy. Neither
  /// waits nor allocates.
  [[nodiscard]] bool offer(std::span<const std::uint16_t> reference_q8, const hal::Light& light,
                           std::shared_ptr<const calibration::Calibration> calibration) noexcept;

  /// Waits until what was offered is written.
  void settle() const noexcept { write_.settle(); }
  /// Why the last write failed and what to do; empty when it went well.
  [[nodiscard]] std::string message() const;
  /// A reference was written: the one of an earlier run is no longer there.
  [[nodiscard]] bool has_written() const noexcept {
    return has_written_.load(std::memory_order_relaxed);
  }

 private:
  void write();

  std::filesystem::path folder_;
  // The side thread's while it is busy, else offer()'s.
  StoredReference pending_;
  std::shared_ptr<const calibration::Calibration> calibration_;
  mutable std::mutex mutex_;  // of message_; never taken on the capture thread
  std::string message_;
  std::atomic<bool> has_written_{false};
  base::BackgroundThread::Job write_;  // last: it uses the others
};

}  // namespace dtact::pipeline
