#pragma once

#include <spdlog/logger.h>

#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace dtact::app {

/// Fields of a log line beside its text, for `journalctl DTACT_HEALTH=camera_fault`. Names as
/// in systemd.journal-fields(7); what is empty is left out.
using LogFields = std::vector<std::pair<const char*, std::string>>;

/// Where everything is logged: to the journal, with priorities and fields, when standard error
/// leads there ($JOURNAL_STREAM), else to standard error as text. A line that repeats the one
/// before is counted for a minute instead of written, and the next line is preceded by the count.
/// Critical is what a process ends with.
[[nodiscard]] std::shared_ptr<spdlog::logger> make_logger();

/// Logs a line with fields.
void log_line(spdlog::level::level_enum level, const std::string& text, const LogFields& fields);

/// The sensor's name, a field of every line from now on. Before any thread is started.
void name_sensor(const std::string& name);

}  // namespace dtact::app
