#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>

namespace dtact::net {

/// One frame message as every client gets it, but for the client's own drop count.
struct EncodedFrame {
  std::string body;  ///< dtact.v1.Frame without `dropped`.
};

/// What stands around a shared body for one client: before it the length and ServerMessage's
/// frame tag, after it the field `dropped`. Fields of one message may come in any order, so a body
/// can be continued without being parsed or copied.
struct FrameEnvelope {
  FrameEnvelope(std::size_t body_size, std::uint64_t dropped) noexcept;

  std::array<std::uint8_t, 16> head{};
  std::size_t head_size = 0;
  std::array<std::uint8_t, 12> tail{};
  std::size_t tail_size = 0;
};

}  // namespace dtact::net
