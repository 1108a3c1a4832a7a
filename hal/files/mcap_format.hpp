#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>

// The MCAP container, https://mcap.dev/spec: a magic, records of an opcode, a length and fields,
// little-endian, and the magic again. Messages lie in compressed chunks; the summary behind them
// says where each chunk is.
namespace dtact::mcap {

inline constexpr std::string_view kMagic("\x89MCAP0\r\n", 8);

enum class Op : std::uint8_t {
  header = 0x01,
  footer = 0x02,
  schema = 0x03,
  channel = 0x04,
  message = 0x05,
  chunk = 0x06,
  message_index = 0x07,
  chunk_index = 0x08,
  attachment = 0x09,
  attachment_index = 0x0A,
  statistics = 0x0B,
  metadata = 0x0C,
  metadata_index = 0x0D,
  summary_offset = 0x0E,
  data_end = 0x0F
};

/// Before a record's fields: its opcode and their length.
inline constexpr std::size_t kRecordHead = 9;
/// Length of a footer's fields.
inline constexpr std::size_t kFooterLength = 20;
/// A record, and a chunk once it is decompressed, has at most this many bytes: what a reader holds.
inline constexpr std::uint64_t kMaxRecord = std::uint64_t{256} << 20U;

/// What the messages of a channel look like; id 0 means none.
struct Schema {
  std::uint16_t id = 0;
  std::string name;
  std::string encoding;  ///< "protobuf", ...; how `data` is to be read.
  std::string data;
  bool operator==(const Schema&) const = default;
};

struct Channel {
  std::uint16_t id = 0;
  std::uint16_t schema = 0;
  std::string topic;
  std::string message_encoding;
  std::map<std::string, std::string> metadata;
  bool operator==(const Channel&) const = default;
};

/// Times are nanoseconds since 1970, UTC.
struct Message {
  std::uint16_t channel = 0;
  std::uint32_t sequence = 0;
  std::uint64_t log_time = 0;
  std::uint64_t publish_time = 0;
  std::string_view data;
};

/// A file in the file.
struct Attachment {
  std::uint64_t log_time = 0;
  std::uint64_t create_time = 0;
  std::string name;
  std::string media_type;
  std::string data;
};

struct Metadata {
  std::string name;
  std::map<std::string, std::string> values;
};

}  // namespace dtact::mcap
