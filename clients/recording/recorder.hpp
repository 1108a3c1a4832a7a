#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <exception>
#include <mutex>
#include <string>
#include <thread>
#include <variant>

#include "clients/recording/recording_writer.hpp"
#include "hal/files/mcap_writer.hpp"
#include "proto/dtact.pb.h"

namespace dtact::recording {

/// Writes a recording on a thread of its own, so that a slow disk does not delay reading from the
/// daemon. The queue is bounded: beyond it frames are dropped and counted, but never events and
/// attachments. The open chunk is written at least once a second.
///
/// When the sink fails, the recording ends: the file is closed if possible, later items are
/// dropped, failed() returns true, and finish() throws.
class Recorder {
 public:
  struct Counts {
    std::uint64_t frames = 0;   ///< Written or waiting to be; once it has failed, written.
    std::uint64_t dropped = 0;  ///< Because the queue was full.
    std::uint64_t bytes = 0;    ///< File size.
  };

  static constexpr std::size_t kMaxWaiting = std::size_t{64} << 20U;  ///< Bytes.

  Recorder(mcap::Sink& sink, const RecordingOptions& options,
           std::size_t max_waiting = kMaxWaiting);
  /// Without finish() the file is left without its index.
  ~Recorder();
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  void add(v1::Frame frame);
  void add(v1::Event event) { put(std::move(event), 0); }
  void add(v1::Status status) { put(std::move(status), 0); }
  void attach(mcap::Attachment attachment) { put(std::move(attachment), 0); }

  [[nodiscard]] bool failed() const;
  [[nodiscard]] Counts counts() const;
  /// Writes what waits and closes the file. Throws what the sink threw.
  void finish();

 private:
  using Item = std::variant<v1::Frame, v1::Event, v1::Status, mcap::Attachment>;
  struct Waiting {
    Item item;
    std::size_t bytes = 0;
  };

  void put(Item item, std::size_t bytes);
  void run();
  void write(Item item);
  void end();

  RecordingWriter writer_;
  const std::size_t max_waiting_;
  mutable std::mutex mutex_;
  std::condition_variable arrived_;
  std::deque<Waiting> queue_;
  std::size_t waiting_bytes_ = 0;
  Counts counts_;
  bool ending_ = false;
  bool finishing_ = false;
  std::exception_ptr failure_;
  std::thread thread_;
};

}  // namespace dtact::recording
