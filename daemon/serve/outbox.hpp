#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <string>

#include "daemon/serve/encoded_frame.hpp"
#include "daemon/serve/transport.hpp"

namespace dtact::v1 {
class ServerMessage;
}

namespace dtact::net {

/// What one client is sent, and in which order. On the network thread.
///
/// Overflow. Frames: one being sent and one waiting; a newer one takes the waiting one's place and
/// the drop is counted. Answers and events: never dropped, sent before the waiting frame; when more
/// than kMaxMessages of them, or more than kMaxBytes beside the largest, lie unread, no more are
/// taken. A reader that has stopped is to be spared frames: stalled().
class Outbox {
 public:
  static constexpr std::size_t kMaxMessages = 1024;
  static constexpr std::size_t kMaxBytes = std::size_t{4} << 20U;
  /// Frames that came in vain while one message was being sent; 1 s of a whole stream.
  static constexpr int kStalledAfter = 60;

  /// The owner of an outbox.
  class Owner {
   public:
    Owner() = default;
    Owner(const Owner&) = delete;
    Owner& operator=(const Owner&) = delete;
    virtual ~Owner() = default;

    /// Keeps the outbox and its transport alive while a write is under way.
    virtual std::shared_ptr<void> hold() = 0;
    /// A write failed; nothing more can be sent.
    virtual void on_write_failed(const std::string& reason) = 0;
    /// waiting_bytes() has changed.
    virtual void on_waiting_changed() = 0;
  };

  Outbox(Transport& transport, Owner& owner) : transport_(transport), owner_(owner) {}

  /// An answer or event; `first`: before all others that wait. False when too much lies unread:
  /// backlog() says how much.
  [[nodiscard]] bool push(const v1::ServerMessage& message, bool first = false);
  void push(std::shared_ptr<const EncodedFrame> frame);
  [[nodiscard]] bool frame_waits() const noexcept { return frame_ != nullptr; }
  /// The waiting frame is not wanted any more.
  void drop_frame() noexcept { frame_.reset(); }
  /// The reader has stopped, so a frame made for it would be wasted. Ends when the present
  /// write has finished.
  [[nodiscard]] bool stalled() const noexcept { return replaced_during_write_ >= kStalledAfter; }
  /// Sends what is queued, then ends the sending side. Nothing may be pushed after it.
  void finish();
  /// The transport is closed: sends nothing more, and calls on_write_failed() no more.
  /// The message being written stays until the transport releases it.
  void close() noexcept { closed_ = true; }

  /// Frames that this client was due and that were gone before they came here.
  void count_dropped(std::uint64_t frames) noexcept { dropped_ += frames; }
  [[nodiscard]] std::uint64_t sent() const noexcept { return sent_; }        ///< Frames.
  [[nodiscard]] std::uint64_t dropped() const noexcept { return dropped_; }  ///< in frames
  /// Whole messages sent, with their lengths.
  [[nodiscard]] std::uint64_t sent_bytes() const noexcept { return sent_bytes_; }
  /// Bytes of answers and events not yet sent.
  [[nodiscard]] std::size_t waiting_bytes() const noexcept { return control_bytes_; }
  /// "3 answers and events (1200 bytes)".
  [[nodiscard]] std::string backlog() const;

 private:
  void write_next();
  void write_control();
  void write_frame();
  void on_written(const boost::system::error_code& error, std::size_t size);
  /// Answers and events that are not sent.
  [[nodiscard]] std::size_t control_count() const noexcept {
    return control_.size() + (sending_control_.empty() ? 0 : 1);
  }

  Transport& transport_;
  Owner& owner_;
  std::deque<std::string> control_;  ///< Answers and events with their lengths.
  std::string sending_control_;      ///< The one that is being sent.
  std::size_t control_bytes_ = 0;
  std::shared_ptr<const EncodedFrame> frame_;    ///< The frame that goes next.
  std::shared_ptr<const EncodedFrame> sending_;  ///< The frame that is being sent.
  FrameEnvelope envelope_{0, 0};                 ///< for `sending_`
  bool writing_ = false;
  bool finishing_ = false;
  bool closed_ = false;
  int replaced_during_write_ = 0;  ///< Frames replaced since this write began.
  std::uint64_t sent_ = 0;
  std::uint64_t dropped_ = 0;
  std::uint64_t sent_bytes_ = 0;
};

}  // namespace dtact::net
