// The depth encodings on a ball held in contact: bytes and time of every encoding for
// three subscriptions, as a Markdown table, and the goals.
//
//   bench_encodings [--sizes] [REAL_IMAGES]
//
// REAL_IMAGES: a folder with sensor_a and sensor_b (ball.png, ball_reference.png); skipped where
// it is missing. Times are CPU time of the one thread: the median of kRuns after two unmeasured
// ones. Every map is decoded and compared before it is timed. --sizes: one run each and no times;
// the exit code is 1 when a goal of size is missed. A map that decodes differently ends the program
// with 1.
#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/net/depth_view.hpp"
#include "proto/depth_encoding.hpp"
#include "tests/bench/cpu_time.hpp"
#include "tests/bench/encodings/maps.hpp"

namespace dtact::bench {
namespace {

constexpr int kFrames = 8;  // frames of the simulated sensor that differ only in noise
constexpr int kRuns = 25;   // for each frame
constexpr double kFps = 60;
constexpr double kEncodeGoalMs = 0.5;

struct Subscription {
  const char* name;
  net::DepthSpec spec;
  double goal_mbit;  ///< Goal at 60 fps, megabits a second.
};
const std::vector<Subscription> kSubscriptions = {
    {"1 µm", {.decimation = 1, .um_per_unit = 1}, 50},
    {"5 µm", {.decimation = 1, .um_per_unit = 5}, 25},
    {"a quarter, 2 µm", {.decimation = 4, .um_per_unit = 2}, 4},
};
constexpr auto kEncodings = {v1::DEPTH_INT16, v1::DEPTH_PREDICT_ZSTD};

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

struct Measured {
  double bytes = 0;  ///< Bytes of a frame.
  double view_ms = 0;
  double encode_ms = 0;
  double decode_ms = 0;
  [[nodiscard]] double mbit() const { return bytes * 8 * kFps * 1e-6; }
};

Measured measure(const Recording& recording, const net::DepthSpec& spec, v1::DepthEncoding encoding,
                 int runs) {
  net::DepthViewer viewer;
  wire::DepthEncoder encoder;
  std::string bytes;
  std::vector<std::int16_t> back;
  std::vector<double> views;
  std::vector<double> encodes;
  std::vector<double> decodes;
  Measured measured;
  for (const auto& frame : recording.frames) {
    for (int run = -2; run < runs; ++run) {
      std::optional<net::DepthView> view;
      const double view_ms = cpu_ms([&] { view = viewer.view(frame, spec); });
      if (!view) throw std::runtime_error(recording.name + ": the map is smaller than a block");
      const auto width = static_cast<std::size_t>(view->width);
      const auto height = static_cast<std::size_t>(view->height);
      bool decoded = false;
      const double encode_ms =
          cpu_ms([&] { encoder.encode(encoding, view->values, width, bytes); });
      const double decode_ms =
          cpu_ms([&] { decoded = wire::decode_depth(encoding, bytes, width, height, back); });
      if (!decoded || !std::ranges::equal(back, view->values)) {
        throw std::runtime_error(fmt::format("{}: encoding {} does not give the map back",
                                             recording.name, static_cast<int>(encoding)));
      }
      if (run < 0) continue;
      views.push_back(view_ms);
      encodes.push_back(encode_ms);
      decodes.push_back(decode_ms);
    }
    measured.bytes += static_cast<double>(bytes.size());
  }
  measured.bytes /= static_cast<double>(recording.frames.size());
  measured.view_ms = median(views);
  measured.encode_ms = median(encodes);
  measured.decode_ms = median(decodes);
  return measured;
}

/// Prints the recording's rows. Appends to `goals` whether the smallest encoding meets the goals
/// of size only or of time as well; false when one of size is missed.
bool report(const Recording& recording, bool sizes, std::string& goals) {
  bool met = true;
  for (const Subscription& wanted : kSubscriptions) {
    for (const auto encoding : kEncodings) {
      const Measured is = measure(recording, wanted.spec, encoding, sizes ? 1 : kRuns);
      fmt::print("| {} | {} | {} | {:.0f} | {:.1f} |", recording.name, wanted.name,
                 v1::DepthEncoding_Name(encoding).substr(6), is.bytes, is.mbit());
      if (!sizes) fmt::print(" {:.2f} | {:.2f} | {:.2f} |", is.view_ms, is.encode_ms, is.decode_ms);
      fmt::print("\n");
      if (encoding != v1::DEPTH_PREDICT_ZSTD) continue;
      const bool small = is.mbit() <= wanted.goal_mbit;
      met = met && small;
      goals += fmt::format("{}  {}, {}: {:.1f} Mbit/s, goal {}\n", small ? "met  " : "SHORT",
                           recording.name, wanted.name, is.mbit(), wanted.goal_mbit);
      if (sizes) continue;
      goals += fmt::format("{}  {}, {}: encoded in {:.2f} ms, goal {}\n",
                           is.encode_ms <= kEncodeGoalMs ? "met  " : "SHORT", recording.name,
                           wanted.name, is.encode_ms, kEncodeGoalMs);
    }
  }
  return met;
}

int run(bool sizes, const std::filesystem::path& real) {
  fmt::print("| ball held in contact | map | encoding | bytes a frame | Mbit/s at 60 fps |{}\n",
             sizes ? "" : " view, ms | encode, ms | decode, ms |");
  fmt::print("| --- | --- | --- | ---: | ---: |{}\n", sizes ? "" : " ---: | ---: | ---: |");
  std::string goals;
  bool met = report(simulated_ball(sizes ? 1 : kFrames), sizes, goals);
  // The published scales of those two sensors (real images beside the repository).
  for (const auto& [sensor, mm_per_px] : {std::pair{"sensor_a", 0.0510}, {"sensor_b", 0.05317}}) {
    if (real.empty() || !std::filesystem::exists(real / sensor)) continue;
    met = report(real_ball(real / sensor, mm_per_px), sizes, goals) && met;
  }
  fmt::print("\n{}", goals);
  return met || !sizes ? 0 : 1;
}

}  // namespace
}  // namespace dtact::bench

int main(int argc, char** argv) {
  const bool sizes = argc > 1 && std::string_view(argv[1]) == "--sizes";
  const int images = sizes ? 2 : 1;
  if (argc > images + 1) {
    fmt::print(stderr, "usage: bench_encodings [--sizes] [REAL_IMAGES]\n");
    return 2;
  }
  try {
    return dtact::bench::run(sizes, argc > images ? argv[images] : "");
  } catch (const std::exception& e) {
    fmt::print(stderr, "bench_encodings: {}\n", e.what());
    return 1;
  }
}
