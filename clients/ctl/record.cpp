#include <fmt/format.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdint>
#include <iostream>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <variant>
#include <vector>

#include "clients/common/interruptible.hpp"
#include "clients/common/json.hpp"
#include "clients/common/reports.pb.h"
#include "clients/common/sibling_program.hpp"
#include "clients/ctl/online.hpp"
#include "clients/recording/channels.hpp"
#include "clients/recording/part_file_sink.hpp"
#include "clients/recording/recorder.hpp"

namespace dtact::ctl {
namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

struct RecordOptions {
  std::string output;
  double seconds = 0;
  double pictures_hz = 10;
  bool no_jpeg = false;
  bool force = false;
  bool progress = false;
  bool ros2 = false;
};

/// Of dtactd depth and images; of dtact-perceive, which has none, points, poses and what the object
/// is.
v1::Subscribe subscription_for(const client::Client& client, const RecordOptions& options) {
  v1::Subscribe subscription;
  if (client.has_feature("cloud")) {
    subscription.set_summary(true);
    subscription.set_cloud(v1::CLOUD_FLOAT32);
    subscription.set_contact_box(true);
    subscription.set_decimation(2);
    subscription.set_pose(true);
    subscription.set_recognition(client.has_feature("recognition"));
    return subscription;
  }
  subscription.set_depth(v1::DEPTH_PREDICT_ZSTD);
  subscription.set_summary(true);
  subscription.set_jpeg(!options.no_jpeg);
  return subscription;
}

/// One run of the command: from the daemon to the file.
class Recording {
 public:
  Recording(const Context& context, const RecordOptions& options)
      : options_(options),
        client_(keeping_frames(context.target)),
        sink_(options.output, options.force),
        recorder_(sink_, {context.target.program, options.pictures_hz}) {}

  /// Until interrupted, the time is over, the disk refuses or the daemon goes.
  void run() {
    const cli::Interruptible interruptible;
    // Before frames come: while an answer is waited for only the newest few are kept.
    const v1::Status status = client_.status();
    fetch_files();
    client_.subscribe(subscription_for(client_, options_));
    const auto end = options_.seconds > 0
                         ? began_ + milliseconds(static_cast<std::int64_t>(options_.seconds * 1e3))
                         : Clock::time_point::max();
    auto shown = began_;
    try {
      while (!cli::Interruptible::happened() && !recorder_.failed() && Clock::now() < end) {
        if (auto item = client_.next(milliseconds(100))) take(*std::move(item), status);
        if (Clock::now() - shown < std::chrono::seconds(1)) continue;
        shown = Clock::now();
        if (options_.progress) show();
      }
    } catch (...) {
      // What came until then is a whole recording.
      recorder_.finish();
      throw;
    }
    recorder_.finish();
  }

  [[nodiscard]] cli::RecordReport report() const {
    const auto counts = recorder_.counts();
    cli::RecordReport report;
    report.set_file(options_.output);
    report.set_frames(counts.frames);
    report.set_missed(skipped_ + seen_ - counts.frames);
    report.set_dropped(counts.dropped);
    report.set_bytes(counts.bytes);
    report.set_seconds(std::chrono::duration<double>(Clock::now() - began_).count());
    return report;
  }

 private:
  /// Frames are kept while a changed calibration's or reference's files come.
  static client::Options keeping_frames(client::Options target) {
    target.kept_frames = 300;
    return target;
  }

  void take(client::Item item, const v1::Status& status) {
    if (auto* event = std::get_if<v1::Event>(&item)) {
      const bool another = event->has_calibration() || event->has_reference();
      recorder_.add(std::move(*event));
      if (!another) return;
      fetch_files();
      if (seen_ > 0) attach_files();
      return;
    }
    auto& frame = std::get<v1::Frame>(item);  // it is never asked to connect again
    // Behind dtact-perceive a daemon that restarts begins anew.
    const bool goes_on = seen_ > 0 && frame.sequence() > last_;
    if (goes_on) skipped_ += frame.sequence() - last_ - 1;
    last_ = frame.sequence();
    recorder_.add(std::move(frame));
    if (seen_++ > 0) return;
    recorder_.add(status);
    attach_files();
    sink_.give_name();
    // The Python package waits for this line.
    std::cerr << "recording to " << options_.output << '\n';
  }

  /// What depth is made by from here on.
  void fetch_files() {
    try {
      const v1::CalibrationFiles files = client_.calibration();
      put(recording::kCalibrationToml, "application/toml", files.calibration_toml());
      put(recording::kReferencePng, "image/png", files.reference_png());
    } catch (const client::Refused& e) {
      // Otherwise uncalibrated, or busy with another one, which an event will report.
      if (e.code() == v1::ERROR_STORAGE) missing("calibration", e);
    } catch (const client::TimeoutError& e) {
      missing("calibration", e);
    }
    try {
      put(recording::kCurrentReferencePng, "image/png", client_.reference().png());
    } catch (const client::Refused&) {  // NOLINT(bugprone-empty-catch)
      // None is taken yet; its event will come.
    } catch (const client::TimeoutError& e) {
      missing("reference", e);
    }
  }

  static void missing(const char* what, const std::exception& why) {
    std::cerr << "the " << what << " in use is not in the recording: " << why.what() << '\n';
  }

  void put(const char* name, const char* media_type, const std::string& data) {
    files_[name] = mcap::Attachment{0, 0, name, media_type, data};
  }

  /// Those that are not in the recording yet.
  void attach_files() {
    for (auto& [name, file] : files_) recorder_.attach(std::move(file));
    files_.clear();
  }

  void show() const {
    const auto now = report();
    std::cerr << fmt::format("\r{:.0f} s, {} frames, {} missed, {:.1f} MB, {:.2f} MB/s ",
                             now.seconds(), now.frames(), now.missed(),
                             static_cast<double>(now.bytes()) * 1e-6,
                             static_cast<double>(now.bytes()) * 1e-6 / now.seconds())
              << std::flush;
  }

  const RecordOptions& options_;
  client::Client client_;
  recording::PartFileSink sink_;
  recording::Recorder recorder_;
  Clock::time_point began_ = Clock::now();
  std::map<std::string, mcap::Attachment> files_;  // that wait for the first frame
  std::uint64_t seen_ = 0;
  std::uint64_t last_ = 0;     // sequence
  std::uint64_t skipped_ = 0;  // frames between those that came
};

void print(const Context& context, const cli::RecordReport& report) {
  if (context.json) {
    context.out << cli::json_line(report);
    return;
  }
  context.out << fmt::format("{}: {} frames in {:.1f} s, {:.1f} MB", report.file(), report.frames(),
                             report.seconds(), static_cast<double>(report.bytes()) * 1e-6);
  if (report.missed() > 0) {
    context.out << fmt::format("; {} missed, {} of them because the disk is slow", report.missed(),
                               report.dropped());
  }
  context.out << '\n';
}

void run_record(const Context& context, const RecordOptions& options) {
  // write() then reports a limit on the file's size, like a full disk, and a reader of the output
  // that is gone, which does not matter to the recording.
  (void)std::signal(SIGXFSZ, SIG_IGN);
  (void)std::signal(SIGPIPE, SIG_IGN);
  Recording recording(context, options);
  try {
    recording.run();
  } catch (const std::system_error& e) {
    if (options.progress) std::cerr << '\n';
    print(context, recording.report());
    throw std::runtime_error(fmt::format(
        "the recording ended early: {}. What was written until then can be read", e.what()));
  } catch (...) {
    if (options.progress) std::cerr << '\n';
    print(context, recording.report());
    throw;
  }
  if (options.progress) std::cerr << '\n';
  const auto report = recording.report();
  print(context, report);
  if (report.frames() == 0) {
    throw std::runtime_error("no frame came: dtactctl status says why");
  }
}

/// Becomes dtact-dds, which records as `command` says. Throws std::runtime_error where there is
/// none.
[[noreturn]] void become_dds(const CLI::App& command, const RecordOptions& options) {
  std::vector<std::string> words = cli::given_options(*command.get_parent());
  words.insert(words.begin(), cli::sibling("dtact-dds"));
  words.insert(words.end(), {"--read-only", "--record", options.output});
  if (options.seconds > 0)
    words.insert(words.end(), {"--seconds", fmt::to_string(options.seconds)});
  if (options.force) words.emplace_back("--force");
  std::vector<char*> arguments;
  arguments.reserve(words.size() + 1);
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  ::execvp(arguments.front(), arguments.data());
  throw std::runtime_error("--ros2 needs dtact-dds: apt install dtact-dds");
}

}  // namespace

void add_record(CLI::App& app, Context& context) {
  auto* command = app.add_subcommand(
      "record", "Record depth, the camera's JPEGs and events as an MCAP file until Ctrl-C");
  const auto options = std::make_shared<RecordOptions>();
  options->progress = ::isatty(STDERR_FILENO) == 1;
  command->add_option("-o,--output", options->output, "The file, press.mcap")
      ->type_name("FILE")
      ->required();
  command->add_option("--seconds", options->seconds, "Seconds after which it ends")
      ->check(cli::positive());
  command
      ->add_option("--pictures-hz", options->pictures_hz,
                   "Depth pictures for eyes a second, beside the lossless frames; 0: none")
      ->capture_default_str()
      ->check(cli::in_range(0.0, 1000.0));
  command->add_flag("--no-jpeg", options->no_jpeg,
                    "Without the camera's JPEGs: depth cannot be made anew then");
  command->add_flag("--force", options->force, "Replace the file if it exists");
  command->add_flag("--progress", options->progress,
                    "Show rate and size also where standard error is no terminal");
  auto* ros2 = command->add_flag("--ros2", options->ros2,
                                 "Record ROS 2 messages as ros2 bag does, by dtact-dds; dtact-dds "
                                 "itself records several sensors in one file");
  ros2->excludes(cli::add_json_option(*command, context));
  ros2->excludes("--pictures-hz", "--no-jpeg", "--progress");
  command->callback([&context, options, command] {
    if (options->ros2) become_dds(*command, *options);
    run_record(context, *options);
  });
}

}  // namespace dtact::ctl
