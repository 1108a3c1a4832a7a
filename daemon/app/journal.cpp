#include "daemon/app/journal.hpp"

#include <fmt/format.h>
#include <spdlog/sinks/base_sink.h>
#include <spdlog/sinks/dup_filter_sink.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <syslog.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstdlib>
#include <iostream>
#include <mutex>
#include <string_view>

// Else each field would name this file as the line's place in the source.
#define SD_JOURNAL_SUPPRESS_LOCATION
#include <systemd/sd-journal.h>

namespace dtact::app {
namespace {

/// How long a line that repeats the one before is only counted.
constexpr std::chrono::seconds kRepeats{60};

/// What log_line() logs on this thread: the sink is called within it.
struct Present {
  std::string_view text;
  const LogFields* fields = nullptr;
};
thread_local Present present;

std::string sensor;

/// $JOURNAL_STREAM names the device and inode of the journal's stream (systemd.exec(5)).
bool is_journal(int fd) {
  const char* stream = std::getenv("JOURNAL_STREAM");
  struct stat status{};
  return stream != nullptr && ::fstat(fd, &status) == 0 &&
         fmt::format("{}:{}", status.st_dev, status.st_ino) == stream;
}

/// syslog(3)'s priorities by spdlog's levels.
constexpr std::array<int, spdlog::level::n_levels> kPriorities = {
    LOG_DEBUG, LOG_DEBUG, LOG_INFO, LOG_WARNING, LOG_ERR, LOG_CRIT, LOG_INFO};

/// Like spdlog's own systemd_sink, with fields. But the last messages of a process go to standard
/// error, which the journal always attributes to the unit. For an entry from the
/// socket it looks up the unit on arrival, which fails when the process has ended.
class JournalSink final : public spdlog::sinks::base_sink<std::mutex> {
  void sink_it_(const spdlog::details::log_msg& msg) override {
    const std::string_view text(msg.payload.data(), msg.payload.size());
    const int priority = kPriorities.at(static_cast<std::size_t>(msg.level));
    if (msg.level == spdlog::level::critical) {
      std::cerr << fmt::format("<{}>{}\n", priority, text);  // sd-daemon(3) names the prefix
      return;
    }
    std::vector<std::string> entry{fmt::format("MESSAGE={}", text),
                                   fmt::format("PRIORITY={}", priority),
                                   "SYSLOG_IDENTIFIER=dtactd"};
    const auto add = [&entry](const char* name, const std::string& value) {
      if (!value.empty()) entry.push_back(fmt::format("{}={}", name, value));
    };
    add("DTACT_SENSOR", sensor);
    // The count of repeated lines is logged within the next one's log_line(), and is not that line.
    if (present.fields != nullptr && present.text == text) {
      for (const auto& [name, value] : *present.fields) add(name, value);
    }
    std::vector<iovec> pieces;
    pieces.reserve(entry.size());
    for (std::string& field : entry) pieces.push_back({field.data(), field.size()});
    if (sd_journal_sendv(pieces.data(), static_cast<int>(pieces.size())) < 0) {
      std::cerr << text << '\n';
    }
  }
  void flush_() override {}
};

}  // namespace

std::shared_ptr<spdlog::logger> make_logger() {
  const auto once = std::make_shared<spdlog::sinks::dup_filter_sink_mt>(kRepeats);
  if (is_journal(STDERR_FILENO)) {
    once->add_sink(std::make_shared<JournalSink>());
  } else {
    once->add_sink(std::make_shared<spdlog::sinks::stderr_color_sink_mt>());
  }
  return std::make_shared<spdlog::logger>("dtactd", once);
}

void log_line(spdlog::level::level_enum level, const std::string& text, const LogFields& fields) {
  present = {text, &fields};
  spdlog::log(level, "{}", text);
  present = {};
}

void name_sensor(const std::string& name) { sensor = name; }

}  // namespace dtact::app
