#include "proto/framing.hpp"

#include <algorithm>
#include <stdexcept>

namespace dtact::wire {
namespace {

/// Memory that is kept for the next message, bytes: requests without files are smaller.
constexpr std::size_t kKept = 4096;

}  // namespace

std::array<std::uint8_t, kLengthSize> encode_length(std::size_t size) {
  if (size > kMaxMessage) {
    throw std::length_error("a message of " + std::to_string(size) +
                            " bytes is above the wire's cap of " + std::to_string(kMaxMessage));
  }
  return {static_cast<std::uint8_t>(size >> 24U), static_cast<std::uint8_t>(size >> 16U),
          static_cast<std::uint8_t>(size >> 8U), static_cast<std::uint8_t>(size)};
}

bool MessageDecoder::take_length(std::string_view& input) noexcept {
  while (head_size_ < kLengthSize) {
    if (input.empty()) return false;
    head_[head_size_++] = static_cast<std::uint8_t>(input.front());
    input.remove_prefix(1);
    if (head_size_ == kLengthSize) {
      length_ = (std::size_t{head_[0]} << 24U) | (std::size_t{head_[1]} << 16U) |
                (std::size_t{head_[2]} << 8U) | std::size_t{head_[3]};
    }
  }
  return true;
}

void MessageDecoder::take_body(std::string_view& input) {
  const std::size_t taken = std::min(input.size(), length_ - message_.size());
  const std::size_t needed = message_.size() + taken;
  if (needed > message_.capacity()) {
    // Into a new string: libstdc++'s reserve() takes twice what a string has, if that is more.
    std::string grown;
    grown.reserve(std::min(length_, 2 * needed));
    grown.append(message_);
    message_.swap(grown);
  }
  message_.append(input.substr(0, taken));
  input.remove_prefix(taken);
}

void MessageDecoder::begin() noexcept {
  complete_ = false;
  head_size_ = 0;
  message_.clear();
}

void MessageDecoder::release() {
  begin();
  if (message_.capacity() > kKept) std::string().swap(message_);
}

MessageDecoder::Result MessageDecoder::feed(std::string_view& input) {
  if (complete_) begin();
  if (!take_length(input)) return Result::need_more;
  if (length_ > cap_) return Result::too_large;
  take_body(input);
  if (message_.size() < length_) return Result::need_more;
  complete_ = true;
  return Result::message;
}

}  // namespace dtact::wire
