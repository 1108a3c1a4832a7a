#include "clients/ctl/cameras.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <ostream>
#include <string>

#include "clients/common/json.hpp"
#include "clients/common/reports.pb.h"
#include "hal/base/utf8.hpp"

namespace dtact::ctl {
namespace {

using hal::v4l2::Mode;
using hal::v4l2::OfferedControl;
using hal::v4l2::SurveyedCamera;

/// Drivers' rates are fractions; 60.00024 is shown as 60.
double rounded(double fps) { return std::round(fps * 100) / 100; }

/// Without control characters in what the camera says of itself, which a terminal would obey.
SurveyedCamera printable(SurveyedCamera camera) {
  hal::v4l2::Attached& who = camera.attached;
  for (std::string* text : {&who.node, &who.by_path, &who.by_id, &who.serial, &who.bus, &who.card,
                            &who.driver, &who.problem, &who.not_taken}) {
    *text = base::printable(*text);
  }
  for (OfferedControl& control : camera.controls) control.name = base::printable(control.name);
  return camera;
}

void print_text(const SurveyedCamera& camera, std::ostream& out) {
  const hal::v4l2::Attached& who = camera.attached;
  fmt::print(out, "{}\n", who.stable_name());
  if (!who.problem.empty()) {
    fmt::print(out, "  {}\n", who.problem);
    return;
  }
  fmt::print(out, "  {} ({}), {} at present\n", who.card, who.driver, who.node);
  std::string others;
  const auto add = [&](const std::string& name) {
    if (name != who.stable_name()) others += (others.empty() ? "" : ", ") + name;
  };
  if (!who.by_id.empty()) add(who.by_id);
  if (!who.serial.empty()) add("serial:" + who.serial);
  if (!who.bus.empty()) add("bus:" + who.bus);
  if (!others.empty()) fmt::print(out, "  or {}\n", others);
  fmt::print(out, "  modes\n");
  for (const Mode& mode : camera.modes) {
    fmt::print(out, "    {}{}\n", hal::v4l2::describe({mode}),
               mode.usable() ? "" : " (not usable)");
  }
  fmt::print(out, "  controls\n");
  for (const OfferedControl& control : camera.controls) {
    fmt::print(out, "    {:<27} {} to {}, step {}, default {}, now {}\n", control.name,
               control.minimum, control.maximum, control.step, control.initial, control.value);
  }
}

/// Nodes that no name never means: in grey, where the terminal has it.
void print_not_taken(const SurveyedCamera& camera, bool terminal, std::ostream& out) {
  const hal::v4l2::Attached& who = camera.attached;
  fmt::print(out, "{}  {} ({}): {}{}\n", terminal ? "\x1b[2m" : "", who.node, who.card,
             who.not_taken, terminal ? "\x1b[22m" : "");
}

cli::AttachedCamera report_of(const SurveyedCamera& camera) {
  const hal::v4l2::Attached& who = camera.attached;
  cli::AttachedCamera report;
  report.set_name(who.stable_name());
  report.set_node(who.node);
  report.set_by_path(who.by_path);
  report.set_by_id(who.by_id);
  report.set_serial(who.serial);
  report.set_bus(who.bus);
  report.set_card(who.card);
  report.set_driver(who.driver);
  report.set_problem(who.problem);
  report.set_not_taken(who.not_taken);
  for (const Mode& mode : camera.modes) {
    cli::CameraMode& to = *report.add_modes();
    to.set_format(mode.format_name());
    to.set_usable(mode.usable());
    to.set_width(mode.width);
    to.set_height(mode.height);
    to.set_min_width(mode.min_width);
    to.set_min_height(mode.min_height);
    to.set_fps_is_range(mode.fps_is_range);
    for (const double fps : mode.fps) to.add_fps(rounded(fps));
  }
  for (const OfferedControl& control : camera.controls) {
    cli::OfferedControl& to = *report.add_controls();
    to.set_name(control.name);
    to.set_minimum(control.minimum);
    to.set_maximum(control.maximum);
    to.set_step(control.step);
    to.set_default_(control.initial);
    to.set_value(control.value);
  }
  return report;
}

}  // namespace

void print_cameras(const std::vector<SurveyedCamera>& cameras, bool json, bool terminal,
                   std::ostream& out) {
  if (json) {
    cli::CamerasReport report;
    for (const SurveyedCamera& camera : cameras) *report.add_cameras() = report_of(camera);
    out << cli::json_line(report);
    return;
  }
  const auto rest = std::ranges::find_if(
      cameras, [](const SurveyedCamera& c) { return !c.attached.not_taken.empty(); });
  if (rest == cameras.begin()) out << "no camera is attached\n";
  for (auto it = cameras.begin(); it != rest; ++it) print_text(printable(*it), out);
  if (rest != cameras.end()) out << "not taken\n";
  for (auto it = rest; it != cameras.end(); ++it) print_not_taken(printable(*it), terminal, out);
}

void add_cameras(CLI::App& app, Context& context) {
  CLI::App* command =
      app.add_subcommand("cameras", "List the cameras attached to this machine (needs no daemon)");
  cli::add_json_option(*command, context);
  command->callback([&context] {
    const bool terminal = &context.out == &std::cout && ::isatty(STDOUT_FILENO) == 1;
    print_cameras(hal::v4l2::survey_cameras(), context.json, terminal, context.out);
  });
}

}  // namespace dtact::ctl
