#pragma once

#include <cerrno>
#include <cstdint>
#include <filesystem>
#include <string>
#include <system_error>
#include <vector>

#include "hal/files/mcap_file_sink.hpp"
#include "proto/depth_encoding.hpp"
#include "proto/dtact.pb.h"

namespace dtact::recording {

inline constexpr std::int64_t kBoot = 1'000'000'000;              // CLOCK_MONOTONIC of frame 0
inline constexpr std::int64_t kWall = 1'700'000'000'000'000'000;  // the same moment

/// Frame `sequence` of 60 a second: a map of 3 × 2 pixels, one of them untrusted, and a JPEG.
inline v1::Frame sample_frame(std::uint64_t sequence) {
  v1::Frame frame;
  const auto passed = static_cast<std::int64_t>(sequence) * 16'666'667;
  frame.set_sequence(sequence);
  frame.set_monotonic_ns(kBoot + passed);
  frame.set_wall_ns(kWall + passed);
  frame.set_frame_id("dtact_surface");
  frame.mutable_light()->set_brightness(128);
  frame.mutable_contact()->set_deepest_mm(1.25);
  auto& map = *frame.mutable_depth();
  map.set_encoding(v1::DEPTH_INT16);
  map.set_width(3);
  map.set_height(2);
  map.set_full_width(3);
  map.set_full_height(2);
  map.set_mm_per_px(0.5);
  map.set_um_per_unit(1);
  map.set_untrusted_value(INT16_MIN);
  wire::encode_int16(std::vector<std::int16_t>{0, 1250, -7, INT16_MIN, 513, 2},
                     *map.mutable_data());
  frame.mutable_jpeg()->set_width(4);
  frame.mutable_jpeg()->set_height(3);
  frame.mutable_jpeg()->set_data("jpeg " + std::to_string(sequence));
  return frame;
}

/// A file that takes at most `room` bytes.
class SmallDisk final : public mcap::Sink {
 public:
  SmallDisk(const std::filesystem::path& path, std::size_t room) : file_(path, true), room_(room) {}
  void append(std::string_view bytes) override {
    if (bytes.size() > room_) {
      throw std::system_error(ENOSPC, std::generic_category(), "small.mcap");
    }
    room_ -= bytes.size();
    file_.append(bytes);
  }
  void sync() override {}

 private:
  mcap::FileSink file_;
  std::size_t room_;
};

}  // namespace dtact::recording
