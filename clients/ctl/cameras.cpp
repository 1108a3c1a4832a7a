#include "clients/ctl/cameras.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <ostream>
#include <string>

#include "clients/ctl/json/json.hpp"

namespace dtact::ctl {
namespace {

using hal::v4l2::Mode;
using hal::v4l2::OfferedControl;
using hal::v4l2::SurveyedCamera;

/// Drivers' rates are fractions; 60.00024 is told as 60.
double rounded(double fps) { return std::round(fps * 100) / 100; }

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

void print_json(const SurveyedCamera& camera, Json& json) {
  const hal::v4l2::Attached& who = camera.attached;
  json.open('{').member("name", who.stable_name()).member("node", who.node);
  json.member("by_path", who.by_path).member("by_id", who.by_id).member("serial", who.serial);
  json.member("bus", who.bus).member("card", who.card).member("driver", who.driver);
  json.member("problem", who.problem).key("modes").open('[');
  for (const Mode& mode : camera.modes) {
    json.open('{').member("format", mode.format_name()).member("usable", mode.usable());
    json.member("width", mode.width).member("height", mode.height);
    json.member("min_width", mode.min_width).member("min_height", mode.min_height);
    json.member("fps_is_range", mode.fps_is_range).key("fps").open('[');
    for (const double fps : mode.fps) json.value(rounded(fps));
    json.close(']').close('}');
  }
  json.close(']').key("controls").open('[');
  for (const OfferedControl& control : camera.controls) {
    json.open('{').member("name", control.name).member("minimum", control.minimum);
    json.member("maximum", control.maximum).member("step", control.step);
    json.member("default", control.initial).member("value", control.value).close('}');
  }
  json.close(']').close('}');
}

}  // namespace

void print_cameras(const std::vector<SurveyedCamera>& cameras, bool json, std::ostream& out) {
  if (json) {
    Json text;
    text.open('[');
    for (const SurveyedCamera& camera : cameras) print_json(camera, text);
    out << text.close(']').text() << '\n';
    return;
  }
  if (cameras.empty()) out << "no camera is attached\n";
  for (const SurveyedCamera& camera : cameras) print_text(camera, out);
}

void add_cameras(CLI::App& app, Context& context) {
  CLI::App* command =
      app.add_subcommand("cameras", "List the cameras attached to this machine (needs no daemon)");
  command->callback(
      [&context] { print_cameras(hal::v4l2::survey_cameras(), context.json, context.out); });
}

}  // namespace dtact::ctl
