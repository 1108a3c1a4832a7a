#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace dtact::wire {

/// Longest message either side accepts, bytes, without its length.
inline constexpr std::size_t kMaxMessage = std::size_t{16} << 20U;
/// The same before Hello, which is all that an unknown peer may send.
inline constexpr std::size_t kMaxBeforeHello = 1024;
/// Bytes of the length that goes before every message.
inline constexpr std::size_t kLengthSize = 4;

/// The four big-endian bytes that go before a message of `size` bytes. Throws std::length_error
/// above kMaxMessage: the other side would end the connection.
[[nodiscard]] std::array<std::uint8_t, kLengthSize> encode_length(std::size_t size);

/// Takes a byte stream apart into messages. Whatever a length promises, memory grows only with the
/// bytes that arrive (at most doubling) and never beyond the cap.
class MessageDecoder {
 public:
  enum class Result : std::uint8_t {
    need_more,  ///< The input is used up.
    message,    ///< message() holds a whole one; feed() the rest of the input for the next.
    too_large   ///< A length above the cap. The stream cannot be followed any further.
  };

  explicit MessageDecoder(std::size_t cap = kMaxMessage) noexcept : cap_(cap) {}

  /// Takes bytes from the front of `input` up to the end of one message. After too_large it takes
  /// nothing and says so again.
  [[nodiscard]] Result feed(std::string_view& input);

  /// The message that feed() completed; empty is a valid message. Valid until the next feed().
  [[nodiscard]] const std::string& message() const noexcept { return message_; }
  /// Releases the message that feed() completed, and its memory when it was large.
  void release();
  /// For the messages that begin from here on.
  void set_cap(std::size_t cap) noexcept { cap_ = cap; }
  [[nodiscard]] std::size_t cap() const noexcept { return cap_; }
  /// Bytes of memory that the message takes so far.
  [[nodiscard]] std::size_t held() const noexcept { return message_.capacity(); }
  /// The length that was too large, bytes.
  [[nodiscard]] std::size_t announced() const noexcept { return length_; }

 private:
  void begin() noexcept;
  [[nodiscard]] bool take_length(std::string_view& input) noexcept;
  void take_body(std::string_view& input);

  std::size_t cap_;
  std::array<std::uint8_t, kLengthSize> head_{};
  std::size_t head_size_ = 0;
  std::size_t length_ = 0;
  bool complete_ = false;  ///< message_ was handed out; the next byte begins another one.
  std::string message_;
};

}  // namespace dtact::wire
