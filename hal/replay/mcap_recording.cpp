#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <stdexcept>
#include <string_view>
#include <utility>
#include <vector>

#include "hal/files/mcap_reader.hpp"
#include "hal/replay/recording.hpp"

namespace dtact::hal::replay {
namespace {

namespace fs = std::filesystem;

constexpr const char* kSchema = "foxglove.CompressedImage";
/// Its fields (github.com/foxglove/schemas): bytes data, string format.
constexpr std::uint64_t kData = 2;
constexpr std::uint64_t kFormat = 3;

/// Takes protobuf's wire format apart (protobuf.dev/programming-guides/encoding): the last value of
/// each field that has a length. The devices know no protobuf, and two fields need none.
class Fields {
 public:
  /// False when the bytes are no message.
  [[nodiscard]] bool parse(std::string_view bytes) {
    while (!bytes.empty()) {
      std::uint64_t key = 0;
      std::uint64_t value = 0;
      if (!varint(bytes, key)) return false;
      switch (key % 8) {
        case 0:
          if (!varint(bytes, value)) return false;
          break;
        case 1:
          if (!skip(bytes, 8)) return false;
          break;
        case 2:
          if (!varint(bytes, value) || value > bytes.size()) return false;
          values_[key / 8] = bytes.substr(0, static_cast<std::size_t>(value));
          bytes.remove_prefix(static_cast<std::size_t>(value));
          break;
        case 5:
          if (!skip(bytes, 4)) return false;
          break;
        default:
          return false;
      }
    }
    return true;
  }
  [[nodiscard]] std::string_view at(std::uint64_t field) const {
    const auto found = values_.find(field);
    return found == values_.end() ? std::string_view() : found->second;
  }

 private:
  static bool varint(std::string_view& bytes, std::uint64_t& value) {
    value = 0;
    for (unsigned shift = 0; shift < 64 && !bytes.empty(); shift += 7) {
      const auto byte = static_cast<unsigned char>(bytes.front());
      bytes.remove_prefix(1);
      value |= std::uint64_t{byte & 0x7FU} << shift;
      if (byte < 0x80) return true;
    }
    return false;
  }
  static bool skip(std::string_view& bytes, std::size_t count) {
    if (bytes.size() < count) return false;
    bytes.remove_prefix(count);
    return true;
  }

  std::map<std::uint64_t, std::string_view> values_;
};

/// The topic of the one channel with pictures.
std::string find_topic(const mcap::Reader& reader, const fs::path& file) {
  std::string topic;
  for (const auto& [id, channel] : reader.channels()) {
    const auto schema = reader.schemas().find(channel.schema);
    if (schema == reader.schemas().end() || schema->second.name != kSchema ||
        channel.message_encoding != "protobuf") {
      continue;
    }
    if (!topic.empty() && topic != channel.topic) {
      fail(file, fmt::format("holds two cameras, {} and {}: keep one (mcap filter)", topic,
                             channel.topic));
    }
    topic = channel.topic;
  }
  if (topic.empty()) {
    fail(file, fmt::format("holds no channel of {}: record from a camera that delivers JPEG, "
                           "without --no-jpeg",
                           kSchema));
  }
  return topic;
}

}  // namespace

Recording load_mcap(const fs::path& file) {
  const mcap::Reader reader(file);
  const std::string topic = find_topic(reader, file);
  struct Frame {
    std::uint64_t time = 0;
    std::string jpeg;
  };
  std::vector<Frame> frames;
  std::size_t bytes = 0;
  std::uint64_t number = 0;
  reader.read({topic}, [&](const mcap::Channel&, const mcap::Message& message) {
    const std::string name = fmt::format("{}, message {}", topic, number++);
    Fields fields;
    if (!fields.parse(message.data)) {
      reader.count_unreadable(fmt::format("{}: is no {}", name, kSchema));
    } else if (fields.at(kFormat) != "jpeg") {
      reader.count_unreadable(fmt::format("{}: its format is \"{}\": only jpeg is played", name,
                                          fields.at(kFormat).substr(0, 16)));
    } else {
      frames.push_back({message.log_time, std::string(fields.at(kData))});
      bytes += frames.back().jpeg.size();
    }
    if (bytes > kMaxBytes) {
      fail(file, fmt::format("more than {} MiB of frames, of which {} are read: record less",
                             kMaxBytes >> 20U, frames.size()));
    }
    return true;
  });
  std::ranges::stable_sort(frames, {}, &Frame::time);
  Recording recording;
  mjpeg::GreyDecoder decoder(1, 1);  // for headers only
  std::uint64_t first = 0;
  for (Frame& frame : frames) {
    const std::string name = fmt::format("{}, the frame at {} ns", topic, frame.time);
    try {
      if (recording.count() > 0) {
        if (frame.time - first > static_cast<std::uint64_t>(kLongestNs)) {
          fail(name, "its time is more than a year after the first frame's");
        }
        if (static_cast<std::int64_t>(frame.time - first) == recording.offsets_ns.back()) {
          fail(name, "another frame has the same time");
        }
      }
      add_jpeg(recording, std::move(frame.jpeg), decoder, name);
    } catch (const std::runtime_error& e) {
      reader.count_unreadable(e.what());
      continue;
    }
    if (recording.count() == 1) first = frame.time;
    recording.offsets_ns.push_back(static_cast<std::int64_t>(frame.time - first));
  }
  recording.left_out = reader.damage();
  if (recording.count() == 0) {
    fail(file, recording.left_out.empty() ? "holds no frame of the camera"
                                          : "no frame can be played: " + recording.left_out);
  }
  return recording;
}

}  // namespace dtact::hal::replay
