#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "hal/files/mcap_reader.hpp"
#include "proto/dtact.pb.h"

namespace dtact::recording {

/// What to do with each message of a recording; what is unset is passed over. They return false for
/// enough. Times are the file's, nanoseconds since 1970.
struct RecordingHandlers {
  /// The frame as sent by the daemon, with its JPEG.
  std::function<bool(const v1::Frame& frame, std::uint64_t log_time)> frame;
  std::function<bool(const v1::Event& event, std::uint64_t log_time)> event;
  std::function<bool(const v1::Status& status, std::uint64_t log_time)> status;
};

/// Goes through a recording in the order of the file. What cannot be read is passed over and
/// counted in the file's damage(). Throws mcap::Error when no channel of it is of dtact.v1.Frame,
/// and when it is damaged so that no frame can be read.
void read_recording(const mcap::Reader& file, const RecordingHandlers& handlers);

/// The last attachment of that name that was taken up to `log_time`, or the first of all; none when
/// there is none of that name.
[[nodiscard]] std::optional<mcap::AttachmentPlace> find_attachment(
    const mcap::Reader& file, const std::string& name, std::uint64_t log_time = UINT64_MAX);

}  // namespace dtact::recording
