#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <iostream>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "clients/common/exit_codes.hpp"
#include "clients/common/interruptible.hpp"
#include "clients/common/json.hpp"
#include "clients/cpp/names.hpp"
#include "clients/ctl/depth_picture.hpp"
#include "clients/ctl/online.hpp"
#include "clients/ctl/screen.hpp"
#include "clients/ctl/watch_meter.hpp"
#include "hal/base/clock.hpp"

namespace dtact::ctl {
namespace {

constexpr std::int64_t kSecondNs = 1'000'000'000;

struct WatchOptions {
  double seconds = 0;  ///< 0: until Ctrl-C
  double min_fps = 0;
  bool summary = false;
  bool draw = false;
};

/// Eyes need no more of each, and a thin link carries it.
constexpr double kDrawnFps = 20;

v1::Subscribe drawn_stream(client::Client& client) {
  const double every = std::ceil(client.status().camera().fps() / kDrawnFps);
  v1::Subscribe subscription;
  subscription.set_depth(v1::DEPTH_PREDICT_ZSTD);
  subscription.set_every(static_cast<std::uint32_t>(std::max(1.0, every)));
  subscription.set_decimation(4);
  subscription.set_um_per_unit(5);
  return subscription;
}

class Watch {
 public:
  Watch(const Context& context, const WatchOptions& options)
      : context_(context),
        options_(options),
        terminal_(!context.json && &context.out == &std::cout && ::isatty(STDOUT_FILENO) == 1),
        client_(context.target),
        simulated_(client_.status().camera().backend() == "sim" ? "simulated  " : "") {}

  void run() {
    const cli::Interruptible while_watching;
    if (options_.draw) screen_.emplace();
    v1::Subscribe subscription = options_.draw ? drawn_stream(client_) : client::depth_stream();
    subscription.set_summary(options_.summary);
    if (options_.summary) subscription.set_depth(v1::DEPTH_NONE);
    client_.subscribe(subscription);
    start_ns_ = now();
    try {
      loop();
    } catch (const client::ConnectionError&) {
      // One Ctrl-C may end the daemon as well.
      if (!cli::Interruptible::happened()) throw;
    }
    finish();
  }

 private:
  static std::int64_t now() { return base::system_clock().monotonic_ns(); }

  void loop() {
    const std::int64_t end_ns = options_.seconds > 0
                                    ? start_ns_ + static_cast<std::int64_t>(options_.seconds * 1e9)
                                    : INT64_MAX;
    const std::int64_t interval_ns = terminal_ ? kSecondNs / 2 : kSecondNs;
    std::int64_t next_line_ns = start_ns_ + interval_ns;
    while (!cli::Interruptible::happened() && now() < end_ns) {
      const auto wait_ns = std::min(next_line_ns, end_ns) - now();
      // At most 100 ms, so that a signal is soon seen.
      auto message = client_.next(
          std::chrono::milliseconds(std::clamp<std::int64_t>(wait_ns / 1'000'000 + 1, 1, 100)));
      if (message.has_value()) {
        if (auto* frame = std::get_if<v1::Frame>(&*message)) take(std::move(*frame));
      }
      if (now() < next_line_ns) continue;
      show();
      next_line_ns += interval_ns;
      // After a pause (Ctrl-Z, a terminal that is not read) the lines left out are not made up for.
      if (next_line_ns <= now()) next_line_ns = now() + interval_ns;
    }
  }

  void take(v1::Frame frame) {
    const std::int64_t now_ns = now();
    const bool counts = options_.summary || frame.has_depth();
    for (auto* meter : {&interval_, &all_}) {
      meter->add(frame, now_ns, client_.same_machine(), counts);
    }
    last_ = std::move(frame);
    if (screen_ && last_.has_depth()) draw(*screen_);
    if (last_.has_depth()) last_.mutable_depth()->clear_data();
  }

  void show() {
    if (interval_.frames() > 0) {
      line(context_.json ? cli::json_line(watch_report(interval_, last_))
                         : simulated_ + watch_line(interval_, last_) + '\n');
    } else {
      show_status();
    }
    interval_.reset();
  }

  void draw(Screen& screen) {
    const Canvas canvas = screen.canvas();
    if (canvas.columns < kMinColumns || canvas.rows < kMinRows) {
      return screen.show({fmt::format("at least {} x {}, please", kMinColumns, kMinRows)});
    }
    // The line may need two of a narrow terminal.
    const Canvas above{canvas.columns, canvas.rows - 1, canvas.palette};
    std::vector<std::string> lines =
        picture_of(last_, cli::full_scale_mm(all_.deepest_mm()), above);
    const auto width = static_cast<std::size_t>(canvas.columns);
    std::size_t end = below_.size() <= width ? below_.size() : below_.rfind("  ", width);
    end = std::min(end, below_.size());
    lines.push_back(below_.substr(0, std::min(end, width)));
    lines.push_back(below_.substr(end, width));
    screen.show(lines);
  }

  void show_status() {
    const v1::Status status = client_.status();
    cli::WatchReport report;
    *report.mutable_status() = status;
    line(context_.json ? cli::json_line(report)
                       : fmt::format("no frames: {}  {}\n", client::name_of(status.state()),
                                     status.advice()));
  }

  /// A new line, or on a terminal the same one again, cut to its width.
  void line(const std::string& text) {
    if (!terminal_) {
      context_.out << text << std::flush;
      return;
    }
    if (screen_) {
      below_ = text.substr(0, text.size() - 1);
      if (interval_.frames() == 0) screen_->show({below_});
      return;
    }
    winsize size{};
    const bool known = ::ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 1;
    const std::size_t width = known ? std::size_t{size.ws_col} - 1 : 120;
    context_.out << "\r\x1b[K" << text.substr(0, std::min(width, text.size() - 1)) << std::flush;
  }

  void finish() {
    if (screen_) {
      screen_.reset();
    } else if (terminal_) {
      context_.out << '\n';
    }
    const std::int64_t end_ns = now();
    const double fps = all_.rate_until(end_ns);
    const double seconds = static_cast<double>(end_ns - start_ns_) * 1e-9;
    const auto& latency = all_.latency();
    if (context_.json) {
      cli::WatchReport report = watch_report(all_, last_);
      report.set_summary(true);
      report.set_fps(fps);
      context_.out << cli::json_line(report);
    } else {
      context_.out << fmt::format("watched {:.1f} s: {} frames, {} with depth, {:.1f} fps; ",
                                  seconds, all_.frames(), options_.summary ? 0 : all_.counted(),
                                  fps);
      if (latency.count() > 0) {
        context_.out << fmt::format("latency p50 {:.1f} ms, p99 {:.1f} ms since {}; ",
                                    latency.percentile_ms(0.5), latency.percentile_ms(0.99),
                                    client::name_of(last_.meaning()));
      }
      std::string flags;
      for (const v1::Health flag : all_.health()) {
        flags += (flags.empty() ? "" : ", ") + client::name_of(flag);
      }
      context_.out << fmt::format("deepest {:.3f} mm; {} dropped; health flags: {}\n",
                                  all_.deepest_mm(), last_.dropped(),
                                  flags.empty() ? "none" : flags);
    }
    if (fps < options_.min_fps) {
      throw cli::Failure(cli::kNotMet,
                         fmt::format("depth came at {:.1f} frames a second, {:g} were asked "
                                     "for: dtactctl status says why",
                                     fps, options_.min_fps));
    }
  }

  const Context& context_;
  WatchOptions options_;
  bool terminal_;
  client::Client client_;
  std::string simulated_;         ///< Begins each line where the sensor is the simulated one.
  std::optional<Screen> screen_;  ///< Drawn on, when asked for.
  std::string below_;             ///< The line under the picture.
  std::int64_t start_ns_ = 0;
  WatchMeter interval_;
  WatchMeter all_;
  v1::Frame last_;  ///< Without the data of its maps.
};

}  // namespace

void add_watch(CLI::App& app, Context& context) {
  auto* command = app.add_subcommand(
      "watch",
      "Show rate, contact, latency since the frame's timestamp (daemon on this machine only; the "
      "summary says which moment the camera stamps), drops and "
      "health until Ctrl-C, then a summary");
  const auto options = std::make_shared<WatchOptions>();
  command->add_option("--seconds", options->seconds, "Seconds after which it ends by itself")
      ->check(cli::positive());
  auto* min_fps =
      command
          ->add_option("--min-fps", options->min_fps,
                       "Exit with 4 when depth came slower, counted from the first depth frame on")
          ->check(cli::in_range(0.0, 1000.0));
  auto* summary = command->add_flag("--summary", options->summary,
                                    "Fetch contact and health only, without the depth maps");
  auto* json = cli::add_json_option(*command, context);
  command
      ->add_flag("--draw", options->draw,
                 "Draw the depth in the terminal's colours, at most 20 times a second")
      ->excludes(min_fps)
      ->excludes(summary)
      ->excludes(json);
  command->callback([&context, options] { Watch(context, *options).run(); });
}

}  // namespace dtact::ctl
