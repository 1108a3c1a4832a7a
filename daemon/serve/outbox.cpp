#include "daemon/serve/outbox.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <boost/asio/buffer.hpp>
#include <utility>

#include "proto/dtact.pb.h"
#include "proto/framing.hpp"

namespace dtact::net {
namespace {

namespace asio = boost::asio;
using boost::system::error_code;

std::string framed(const v1::ServerMessage& message) {
  const auto length = wire::encode_length(message.ByteSizeLong());
  std::string bytes(reinterpret_cast<const char*>(length.data()), length.size());
  message.AppendToString(&bytes);
  return bytes;
}

}  // namespace

bool Outbox::push(const v1::ServerMessage& message, bool first) {
  // An answer may be as large as a message: a client that is reading it is not behind.
  std::size_t largest = sending_control_.size();
  for (const std::string& waiting : control_) largest = std::max(largest, waiting.size());
  if (control_count() >= kMaxMessages || control_bytes_ - largest > kMaxBytes) return false;
  std::string bytes = framed(message);
  control_bytes_ += bytes.size();
  control_.insert(first ? control_.begin() : control_.end(), std::move(bytes));
  owner_.on_waiting_changed();
  if (!writing_) write_next();
  return true;
}

void Outbox::push(std::shared_ptr<const EncodedFrame> frame) {
  if (frame_ != nullptr) {
    ++dropped_;
    ++replaced_during_write_;
  }
  frame_ = std::move(frame);
  if (!writing_) write_next();
}

void Outbox::finish() {
  finishing_ = true;
  frame_.reset();
  if (!writing_) write_next();
}

std::string Outbox::backlog() const {
  return fmt::format("{} answers and events ({} bytes)", control_count(), control_bytes_);
}

void Outbox::write_next() {
  if (!control_.empty()) return write_control();
  if (frame_ != nullptr) return write_frame();
  if (finishing_) transport_.shutdown_send(owner_.hold());
}

void Outbox::write_control() {
  writing_ = true;
  sending_control_ = std::move(control_.front());
  control_.pop_front();
  transport_.write({asio::buffer(sending_control_)},
                   [this, held = owner_.hold()](const error_code& error, std::size_t size) {
                     if (closed_) return;
                     control_bytes_ -= sending_control_.size();
                     sending_control_ = std::string();  // returns its memory, unlike clear()
                     owner_.on_waiting_changed();
                     on_written(error, size);
                   });
}

void Outbox::write_frame() {
  writing_ = true;
  sending_ = std::move(frame_);
  envelope_ = FrameEnvelope(sending_->body.size(), dropped_);
  transport_.write(
      {asio::buffer(envelope_.head.data(), envelope_.head_size), asio::buffer(sending_->body),
       asio::buffer(envelope_.tail.data(), envelope_.tail_size)},
      [this, held = owner_.hold()](const error_code& error, std::size_t size) {
        sending_.reset();
        if (closed_) return;
        if (!error) ++sent_;
        on_written(error, size);
      });
}

void Outbox::on_written(const error_code& error, std::size_t size) {
  writing_ = false;
  replaced_during_write_ = 0;
  if (error) return owner_.on_write_failed(error.message());
  sent_bytes_ += size;
  write_next();
}

}  // namespace dtact::net
