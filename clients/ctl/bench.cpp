#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <ostream>
#include <vector>

#include "clients/common/exit_codes.hpp"
#include "clients/common/interruptible.hpp"
#include "clients/common/json.hpp"
#include "clients/cpp/names.hpp"
#include "clients/ctl/bench_meter.hpp"
#include "clients/ctl/clock_offset.hpp"
#include "clients/ctl/online.hpp"
#include "hal/base/clock.hpp"

namespace dtact::ctl {
namespace {

/// The shortest ping counts; with this many, one falls between two frames.
constexpr int kPings = 24;
/// Passed over at the start: what was on the way, and a congestion window that still grows.
constexpr double kWarmUpSeconds = 0.5;

struct BenchOptions {
  double seconds = 5;
  bool encodings = false;
};

class Bench {
 public:
  Bench(const Context& context, const BenchOptions& options)
      : context_(context), options_(options), client_(context.target) {}

  void run() {
    const cli::Interruptible while_measuring;
    std::vector<v1::DepthEncoding> encodings = {v1::DEPTH_INT16};
    if (options_.encodings) {
      encodings.clear();
      for (int i = v1::DepthEncoding_MIN; i <= v1::DepthEncoding_MAX; ++i) {
        encodings.push_back(static_cast<v1::DepthEncoding>(i));
      }
    }
    bool first = true;
    for (const v1::DepthEncoding encoding : encodings) {
      const cli::BenchReport report = measure(encoding);
      if (cli::Interruptible::happened()) break;
      if (context_.json) {
        context_.out << cli::json_line(report) << std::flush;
      } else {
        context_.out << (std::exchange(first, false) ? head(report) : "") << bench_line(report)
                     << std::flush;
      }
      if (report.refused().empty() && report.frames() == 0) {
        throw cli::Failure(cli::kNotMet, "no frame came: dtactctl status says why");
      }
    }
  }

 private:
  static std::int64_t now() { return base::system_clock().monotonic_ns(); }

  [[nodiscard]] std::string head(const cli::BenchReport& report) const {
    const std::string clock =
        client_.same_machine()
            ? "the same"
            : fmt::format("{:.3f} ms ahead of this machine's, +- {:.3f}", report.clock_offset_ms(),
                          report.clock_uncertainty_ms());
    return fmt::format("latency since {}; the daemon's clock: {}\n",
                       client::name_of(report.since()), clock) +
           bench_head();
  }

  cli::BenchReport measure(v1::DepthEncoding encoding) {
    v1::Subscribe subscription;
    subscription.set_depth(encoding);
    subscription.set_summary(encoding == v1::DEPTH_NONE);
    try {
      client_.subscribe(subscription);
    } catch (const client::Refused& refused) {
      cli::BenchReport report;
      report.set_encoding(encoding);
      report.set_refused(refused.what());
      return report;
    }
    (void)stream(kWarmUpSeconds);
    const v1::CameraStatus camera_before = ask_camera();
    const bool pings = !client_.same_machine();
    const ClockOffset before = pings ? ask_clock() : ClockOffset{};
    const BenchMeter meter = stream(options_.seconds);
    const ClockOffset after = pings ? ask_clock() : ClockOffset{};
    cli::BenchReport report =
        meter.report([&](std::int64_t at_ns) { return offset_at(before, after, at_ns); });
    report.set_encoding(encoding);
    const v1::CameraStatus camera = ask_camera();
    report.set_lost(camera.lost() - camera_before.lost());
    report.set_skipped(camera.skipped() - camera_before.skipped());
    if (pings) {
      report.set_clock_offset_ms(static_cast<double>(after.offset_ns) * 1e-6);
      report.set_clock_uncertainty_ms(
          static_cast<double>(std::max(before.uncertainty_ns, after.uncertainty_ns)) * 1e-6);
    }
    return report;
  }

  ClockOffset ask_clock() {
    std::vector<ClockPing> pings;
    for (int i = 0; i < kPings; ++i) {
      const std::int64_t sent_ns = now();
      const std::int64_t theirs_ns = client_.ping().monotonic_ns();
      pings.push_back({sent_ns, now(), theirs_ns});
    }
    discard_waiting();
    return shortest_round_trip(pings);
  }

  v1::CameraStatus ask_camera() {
    v1::CameraStatus camera = client_.status().camera();
    discard_waiting();
    return camera;
  }

  /// What came during a request waited for it and says nothing of the connection.
  void discard_waiting() {
    while (client_.next(std::chrono::milliseconds(0)).has_value()) {
    }
  }

  BenchMeter stream(double seconds) {
    BenchMeter meter;
    const std::int64_t end_ns = now() + static_cast<std::int64_t>(seconds * 1e9);
    while (!cli::Interruptible::happened() && now() < end_ns) {
      const auto message = client_.next(std::chrono::milliseconds(100));
      if (!message.has_value()) continue;
      if (const auto* frame = std::get_if<v1::Frame>(&*message)) meter.add(*frame, now());
    }
    return meter;
  }

  const Context& context_;
  BenchOptions options_;
  client::Client client_;
};

}  // namespace

void add_bench(CLI::App& app, Context& context) {
  auto* command = app.add_subcommand(
      "bench",
      "Measure the connection: rate, latency since the frame's timestamp (between machines by an "
      "estimate of their clocks' offset), jitter, bytes, frames missed here, skipped by the daemon "
      "and lost by the camera");
  const auto options = std::make_shared<BenchOptions>();
  command->add_option("--seconds", options->seconds, "Seconds to measure, of each encoding")
      ->check(cli::positive())
      ->capture_default_str();
  command->add_flag("--encodings", options->encodings,
                    "Every encoding of depth one after another, not the plain one alone");
  cli::add_json_option(*command, context);
  command->callback([&context, options] { Bench(context, *options).run(); });
}

}  // namespace dtact::ctl
