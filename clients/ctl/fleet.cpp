#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <filesystem>
#include <functional>
#include <future>
#include <memory>
#include <ostream>
#include <string>
#include <string_view>
#include <vector>

#include "clients/common/avahi.hpp"
#include "clients/common/daemon_option.hpp"
#include "clients/common/exit_codes.hpp"
#include "clients/common/json.hpp"
#include "clients/common/printable.hpp"
#include "clients/cpp/names.hpp"
#include "clients/ctl/online.hpp"

namespace dtact::ctl {
namespace {

struct FleetOptions {
  const CLI::App* program = nullptr;
  std::vector<std::string> daemons;
  double timeout_s = 5;
  std::string folder;
  std::string name;
  bool force = false;
};

using Reports = std::vector<cli::FleetReport>;
/// Asks one daemon; fills its report or throws.
using Request = std::function<void(client::Client&, cli::FleetReport&)>;
/// The cells of a daemon that has answered, and their heading.
struct Columns {
  std::vector<std::string> heading;
  std::function<std::vector<std::string>(const cli::FleetReport&)> cells;
};

std::vector<cli::Finder::Found> daemons_of(const Context& context, const FleetOptions& options) {
  // Found ones have addresses and certificates of their own, and --daemon says all.
  for (const char* one :
       {"--host", "--port", "--fingerprint", "--insecure", "--token-file", "--ca-file"}) {
    const bool of_all = options.daemons.empty() && std::string_view(one).ends_with("-file");
    if (options.program->get_option(one)->count() > 0 && !of_all) {
      throw CLI::ExcludesError("fleet", one);
    }
  }
  std::vector<cli::Finder::Found> all;
  for (cli::NamedDaemon& one : cli::parse_daemons("--daemon", options.daemons, context.target)) {
    all.push_back({std::move(one), {}});
  }
  if (all.empty()) all = cli::Finder(context.target).look(std::chrono::seconds(3));
  if (all.empty()) throw cli::Failure(cli::kNotMet, cli::kNoneAnnounced);
  return all;
}

cli::FleetReport ask(const cli::Finder::Found& found, std::chrono::milliseconds timeout,
                     const Request& request) {
  cli::FleetReport report;
  report.set_name(found.daemon.name);
  report.set_error(found.refused);
  if (!found.refused.empty()) return report;
  try {
    client::Options options = found.daemon.options;
    options.timeout = timeout;
    client::Client client(options);
    report.set_well(true);
    request(client, report);
  } catch (const std::exception& e) {
    report.set_well(false);
    report.set_error(e.what());
  }
  return report;
}

/// Asks all at the same time, each on a thread.
Reports ask_all(const Context& context, const FleetOptions& options, const Request& request) {
  const std::chrono::milliseconds timeout(
      static_cast<std::chrono::milliseconds::rep>(options.timeout_s * 1000));
  const auto daemons = daemons_of(context, options);
  std::vector<std::future<cli::FleetReport>> answers;
  answers.reserve(daemons.size());
  for (const auto& found : daemons) {
    answers.push_back(std::async(std::launch::async, ask, std::cref(found), timeout, request));
  }
  Reports reports;
  reports.reserve(answers.size());
  for (auto& answer : answers) reports.push_back(answer.get());
  return reports;
}

/// Of a daemon that did not answer the row has the reason.
void print_table(const Reports& reports, const Columns& columns, std::ostream& out) {
  std::vector<std::vector<std::string>> rows{columns.heading};
  rows.front().insert(rows.front().begin(), "name");
  for (const auto& report : reports) {
    std::vector<std::string> row{report.name()};
    if (report.error().empty()) {
      for (std::string& cell : columns.cells(report)) row.push_back(std::move(cell));
    } else {
      row.push_back(report.error());
    }
    rows.push_back(std::move(row));
  }
  std::vector<std::size_t> widths(rows.front().size());
  for (const auto& row : rows) {
    for (std::size_t i = 0; i + 1 < row.size(); ++i) {
      widths[i] = std::max(widths[i], row[i].size());
    }
  }
  for (const auto& row : rows) {
    for (std::size_t i = 0; i + 1 < row.size(); ++i)
      out << fmt::format("{:<{}}  ", row[i], widths[i]);
    out << row.back() << '\n';
  }
}

/// Returns normally if all are well.
void report(const Context& context, const Reports& reports, const Columns& columns) {
  if (context.json) {
    for (const auto& one : reports) context.out << cli::json_line(one);
  } else {
    Reports printable = reports;
    for (auto& one : printable) cli::make_printable(one);
    print_table(printable, columns, context.out);
    for (const auto& one : printable) {
      if (!one.status().advice().empty()) {
        context.out << fmt::format("\n{}: {}\n", one.name(), one.status().advice());
      }
    }
  }
  std::vector<std::string> unwell;
  for (const auto& one : reports) {
    if (!one.well()) unwell.push_back(one.name());
  }
  if (unwell.empty()) return;
  throw cli::Failure(cli::kFailed, fmt::format("{} of {} not well: {}", unwell.size(),
                                               reports.size(), fmt::join(unwell, ", ")));
}

void status(const Context& context, const FleetOptions& options) {
  const auto reports =
      ask_all(context, options, [](client::Client& client, cli::FleetReport& report) {
        *report.mutable_status() = client.status();
        report.set_well(report.status().state() == v1::STATE_SERVING &&
                        report.status().health().empty());
      });
  report(context, reports,
         {{"state", "fps", "version", "health"}, [](const cli::FleetReport& one) {
            const v1::Status& status = one.status();
            return std::vector<std::string>{
                client::name_of(status.state()), fmt::format("{:.1f}", status.fps()),
                status.version(),
                status.health().empty()
                    ? "ok"
                    : fmt::format("{}", fmt::join(client::names_of(status.health()), ", "))};
          }});
}

void upload(const Context& context, const FleetOptions& options) {
  const std::filesystem::path folder = options.folder;
  const auto reports =
      ask_all(context, options, [&](client::Client& client, cli::FleetReport& report) {
        const v1::UploadCalibration files = read_calibration(
            folder / report.name(), options.name.empty() ? report.name() : options.name);
        report.set_calibration(client.upload_calibration(files).calibration());
      });
  report(context, reports, {{"calibration"}, [](const cli::FleetReport& one) {
                              return std::vector<std::string>{fmt::format("{}", one.calibration())};
                            }});
}

void rezero(const Context& context, const FleetOptions& options) {
  const auto reports = ask_all(context, options, [&](client::Client& client, cli::FleetReport&) {
    client.rezero(options.force);
  });
  report(context, reports,
         {{"reference"}, [](const cli::FleetReport&) { return std::vector<std::string>{"new"}; }});
}

}  // namespace

void add_fleet(CLI::App& app, Context& context) {
  auto* command = app.add_subcommand(
      "fleet", "Ask many daemons at the same time; the exit code is 0 if all are well, else 1");
  command->require_subcommand(1);
  const auto options = std::make_shared<FleetOptions>();
  options->program = &app;
  cli::add_daemon_option(*command, options->daemons, "in the table",
                         "it is all that dtactctl find lists, with --token-file and --ca-file");
  command->add_option("--timeout", options->timeout_s, "Seconds that each may take to answer")
      ->check(cli::positive())
      ->capture_default_str();
  auto* state = command->add_subcommand(
      "status", "Show state, rate, version and health; well is who serves without a health flag");
  state->callback([&context, options] { status(context, *options); });

  auto* send = command->add_subcommand("upload", "Send each its calibration; it is used at once");
  send->add_option("FOLDER", options->folder, "Has a calibration folder of the name of each daemon")
      ->required()
      ->check(CLI::ExistingDirectory);
  send->add_option("--name", options->name, "Its name at the daemons (default: the folder's)");
  send->callback([&context, options] { upload(context, *options); });

  auto* renew =
      command->add_subcommand("rezero", "Take new reference images; refused during contact");
  renew->add_flag("--force", options->force, "Also during contact: it will read as zero depth");
  renew->callback([&context, options] { rezero(context, *options); });
  for (CLI::App* verb : command->get_subcommands({})) cli::add_json_option(*verb, context);
}

}  // namespace dtact::ctl
