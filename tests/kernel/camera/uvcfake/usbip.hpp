#pragma once

#include <array>
#include <cstdint>

/// The USB/IP protocol as the kernel's virtual host controller speaks it (Documentation/usb/
/// usbip_protocol.rst). All fields are big-endian.
namespace uvcfake::usbip {

enum Command : std::uint32_t { kSubmit = 1, kUnlink = 2, kSubmitReply = 3, kUnlinkReply = 4 };

struct SubmitPart {
  std::uint32_t flags;
  std::uint32_t length;
  std::uint32_t start_frame;
  std::uint32_t packets;  ///< Isochronous packets; 0 or all ones = not isochronous.
  std::uint32_t interval;
  std::array<std::uint8_t, 8> setup;
};

struct ReplyPart {
  std::uint32_t status;  ///< 0 or a negative errno.
  std::uint32_t actual;  ///< Bytes.
  std::uint32_t start_frame;
  std::uint32_t packets;
  std::uint32_t errors;
  std::array<std::uint8_t, 8> padding;
};

struct Header {
  std::uint32_t command;
  std::uint32_t sequence;
  std::uint32_t device;
  std::uint32_t direction;  ///< 1 = to the host.
  std::uint32_t endpoint;
  union {
    SubmitPart submit;
    ReplyPart reply;
    std::uint32_t unlink_sequence;
  };
};
static_assert(sizeof(Header) == 48);

struct IsoPacket {
  std::uint32_t offset;
  std::uint32_t length;
  std::uint32_t actual;
  std::uint32_t status;
};

}  // namespace uvcfake::usbip
