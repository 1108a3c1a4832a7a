#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "hal/files/mcap_writer.hpp"
#include "proto/dtact.pb.h"

namespace dtact::recording {

struct RecordingOptions {
  std::string program;      ///< Who records: "dtactctl 0.1.0".
  double pictures_hz = 10;  ///< Depth images, or point clouds, for viewing, per second; 0: none.
};

/// Writes the daemon's messages as an MCAP file (see README.md in this folder). Passes on
/// exceptions of the sink; mcap::Writer explains the state of the file then. One thread.
///
/// All times in the file start at the first frame's wall time and continue with CLOCK_MONOTONIC, so
/// that setting the wall clock during the recording does not reorder it.
class RecordingWriter {
 public:
  RecordingWriter(mcap::Sink& sink, const RecordingOptions& options);

  /// With its JPEG, if it has one, which is stored on a channel of its own.
  void add(v1::Frame frame);
  void add(const v1::Event& event);
  /// Both store with the time of the last frame or event; there must be one.
  void add(const v1::Status& status);
  void attach(const std::string& name, const std::string& media_type, const std::string& data);

  void flush() { writer_.flush(); }
  void finish() { writer_.finish(); }
  [[nodiscard]] std::uint64_t bytes() const noexcept { return writer_.bytes(); }
  /// Frames that the file holds so far, without those of the open chunk.
  [[nodiscard]] std::uint64_t frames() const { return writer_.written(frame_); }

 private:
  struct Moment {
    std::uint64_t log_time = 0;
    std::uint64_t publish_time = 0;  ///< The daemon's wall clock.
    std::uint64_t sequence = 0;      ///< The frame's, or the last one's before an event.
  };
  [[nodiscard]] Moment moment_of(std::uint64_t sequence, std::int64_t monotonic_ns,
                                 std::int64_t wall_ns);
  [[nodiscard]] std::uint16_t add_channel(const char* topic,
                                          const google::protobuf::Descriptor& type,
                                          const std::map<std::string, std::string>& metadata = {});
  void add_message(std::uint16_t channel, const google::protobuf::Message& message);
  /// Writes to a channel that is made when it is first needed.
  void add_message(std::uint16_t& channel, const char* topic,
                   const google::protobuf::Message& message);
  [[nodiscard]] bool picture_due(const v1::Frame& frame);
  void add_picture(const v1::Frame& frame);
  void add_points(const v1::Frame& frame);
  void add_jpeg(const v1::Frame& frame);
  void add_light(const v1::LightState& light);

  mcap::Writer writer_;
  std::int64_t picture_interval_ns_;
  std::uint16_t frame_;
  std::uint16_t event_;
  std::uint16_t light_;
  std::uint16_t status_;
  std::uint16_t jpeg_ = 0;
  std::uint16_t picture_ = 0;
  std::uint16_t points_ = 0;
  std::uint16_t pose_ = 0;
  std::uint16_t transforms_ = 0;
  bool points_shown_ = false;  ///< The last points were some.
  /// Wall time of CLOCK_MONOTONIC's zero, at the first frame or event of a boot.
  std::optional<std::int64_t> epoch_ns_;
  std::int64_t newest_ns_ = 0;  ///< CLOCK_MONOTONIC of the newest one.
  Moment now_;
  std::int64_t next_picture_ns_ = 0;
  std::string last_light_;
  std::string buffer_;
};

}  // namespace dtact::recording
