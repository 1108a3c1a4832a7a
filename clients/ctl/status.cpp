#include <fmt/format.h>
#include <fmt/ostream.h>

#include <CLI/CLI.hpp>
#include <ostream>

#include "clients/ctl/calibration_text.hpp"
#include "clients/ctl/json/json.hpp"
#include "clients/ctl/light_text.hpp"
#include "clients/ctl/online.hpp"

namespace dtact::ctl {
namespace {

using client::Status;

std::string joined(const std::vector<std::string>& texts) {
  return texts.empty() ? "-" : fmt::format("{}", fmt::join(texts, ", "));
}

void print_camera(const Status::Camera& camera, std::ostream& out) {
  fmt::print(out, "camera       {} {}, {}x{} {} at {:g} fps, {}\n", camera.backend, camera.identity,
             camera.width, camera.height, camera.pixel_format, camera.fps, camera.condition);
  if (!camera.remedy.empty()) fmt::print(out, "             {}\n", camera.remedy);
  fmt::print(out, "             delivered {}, lost {}, skipped {}, damaged {}, disconnects {}\n",
             camera.delivered, camera.lost, camera.skipped, camera.damaged, camera.disconnects);
  if (camera.damaged > 0) {
    fmt::print(out,
               "             damaged: {} marked, {} without markers, {} short, {} undecodable\n",
               camera.damaged_flagged, camera.damaged_markers, camera.damaged_short,
               camera.damaged_undecodable);
  }
  if (!camera.moved.empty()) fmt::print(out, "             {}\n", camera.moved);
  for (const auto& control : camera.controls) {
    fmt::print(out, "             {} {}{}{}\n", control.name, control.value,
               control.locked ? "" : " (not locked)",
               control.note.empty() ? "" : ": " + control.note);
  }
}

void print_calibration(const Status& status, std::ostream& out) {
  if (!status.calibration.has_value()) {
    fmt::print(out, "calibration  none\n");
    return;
  }
  fmt::print(out, "calibration  {}\n", text_of(*status.calibration));
}

void print(const Status& status, std::ostream& out) {
  fmt::print(out, "state        {}\nhealth       {}\n", status.state,
             status.health.empty() ? "ok" : joined(status.health));
  if (!status.advice.empty()) fmt::print(out, "advice       {}\n", status.advice);
  print_camera(status.camera, out);
  fmt::print(out, "ring         {} {}\n", status.ring.backend, status.ring.identity);
  if (!status.ring.message.empty()) fmt::print(out, "             {}\n", status.ring.message);
  fmt::print(out, "light        {}\n", text_of(status.light));
  print_calibration(status, out);
  if (status.light_followed != 0) {
    fmt::print(out, "reference    follows the light by {:+.2f} %\n", 100 * status.light_followed);
  }
  fmt::print(out, "frames       {} published, {} skipped, {} encoded, {:.1f} fps\n", status.frames,
             status.skipped, status.encoded, status.fps);
  for (const auto& stage : status.stages) {
    fmt::print(out, "  {:<10} p50 {:.0f} us, p99 {:.0f} us, max {:.0f} us\n", stage.name,
               stage.p50_us, stage.p99_us, stage.max_us);
  }
  const auto& usage = status.capture_thread;
  fmt::print(out,
             "capture      page faults {} minor, {} major; context switches {} waiting, {} "
             "preempted\n",
             usage.minor_faults, usage.major_faults, usage.waits, usage.preemptions);
  for (const auto& refused : status.realtime_refused) fmt::print(out, "realtime     {}\n", refused);
  for (const auto& c : status.clients) {
    fmt::print(out, "client       {} {}, sent {}, dropped {}\n", c.address, c.program, c.sent,
               c.dropped);
  }
  fmt::print(out, "version      {}, up {:.0f} s\n", status.version, status.uptime_s);
}

void add_camera(const Status::Camera& camera, Json& json) {
  json.key("camera").open('{').member("backend", camera.backend);
  json.member("identity", camera.identity).member("pixel_format", camera.pixel_format);
  json.member("width", camera.width).member("height", camera.height).member("fps", camera.fps);
  json.member("condition", camera.condition).member("remedy", camera.remedy);
  json.member("delivered", camera.delivered).member("lost", camera.lost);
  json.member("skipped", camera.skipped).member("damaged", camera.damaged);
  json.member("damaged_flagged", camera.damaged_flagged);
  json.member("damaged_markers", camera.damaged_markers);
  json.member("damaged_short", camera.damaged_short);
  json.member("damaged_undecodable", camera.damaged_undecodable);
  json.member("disconnects", camera.disconnects).member("moved", camera.moved);
  json.key("controls").open('[');
  for (const auto& control : camera.controls) {
    json.open('{').member("name", control.name).member("value", control.value);
    json.member("locked", control.locked).member("note", control.note).close('}');
  }
  json.close(']').close('}');
}

std::string as_json(const Status& status) {
  Json json;
  json.open('{').member("state", status.state).member("health", status.health);
  json.member("advice", status.advice);
  add_camera(status.camera, json);
  json.key("ring").open('{').member("backend", status.ring.backend);
  json.member("identity", status.ring.identity).member("message", status.ring.message).close('}');
  json.key("light");
  add_light(status.light, json);
  json.key("calibration");
  if (status.calibration.has_value()) {
    add_summary(*status.calibration, json);
  } else {
    json.null();
  }
  json.member("frames", status.frames).member("skipped", status.skipped).member("fps", status.fps);
  json.member("light_followed", status.light_followed);
  json.member("realtime_refused", status.realtime_refused).key("stages").open('[');
  for (const auto& stage : status.stages) {
    json.open('{').member("name", stage.name).member("p50_us", stage.p50_us);
    json.member("p99_us", stage.p99_us).member("max_us", stage.max_us).close('}');
  }
  json.close(']').key("clients").open('[');
  for (const auto& c : status.clients) {
    json.open('{').member("address", c.address).member("program", c.program);
    json.member("sent", c.sent).member("dropped", c.dropped).close('}');
  }
  json.close(']').member("version", status.version).member("uptime_s", status.uptime_s);
  json.member("encoded", status.encoded).key("capture_thread").open('{');
  const auto& usage = status.capture_thread;
  json.member("minor_faults", usage.minor_faults).member("major_faults", usage.major_faults);
  json.member("waits", usage.waits).member("preemptions", usage.preemptions).close('}').close('}');
  return json.text();
}

}  // namespace

void add_status(CLI::App& app, Context& context) {
  app.add_subcommand("status", "Show the daemon's state, health and what to do about it")
      ->callback([&context] {
        const auto status = client::Client(context.target).status();
        if (context.json) {
          context.out << as_json(status) << '\n';
        } else {
          print(status, context.out);
        }
      });
}

}  // namespace dtact::ctl
