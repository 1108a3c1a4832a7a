#include <fmt/format.h>
#include <fmt/ostream.h>

#include <CLI/CLI.hpp>
#include <ostream>

#include "clients/common/json.hpp"
#include "clients/common/printable.hpp"
#include "clients/cpp/names.hpp"
#include "clients/ctl/calibration_text.hpp"
#include "clients/ctl/light_text.hpp"
#include "clients/ctl/online.hpp"
#include "clients/ctl/reconstruction_text.hpp"

namespace dtact::ctl {
namespace {

/// What is known of a control. A daemon from before the verdict says `locked` alone.
const char* words_of(const v1::CameraControl& control) {
  switch (control.verdict()) {
    case v1::CONTROL_VERDICT_CONFIRMED:
      return "confirmed by the camera";
    case v1::CONTROL_VERDICT_ACCEPTED:
      return "accepted, cannot be confirmed";
    case v1::CONTROL_VERDICT_REFUSED:
      return "refused";
    default:
      return control.locked() ? "locked" : "not locked";
  }
}

void print_camera(const v1::CameraStatus& camera, std::ostream& out) {
  fmt::print(out, "camera       {} {}{}, {}x{} {} at {:g} fps, {}\n", camera.backend(),
             camera.identity(), camera.backend() == "sim" ? " (simulated)" : "", camera.width(),
             camera.height(), camera.pixel_format(), camera.fps(), camera.state());
  if (!camera.fix().empty()) fmt::print(out, "             {}\n", camera.fix());
  fmt::print(out, "             delivered {}, lost {}, skipped {}, damaged {}, disconnects {}\n",
             camera.delivered(), camera.lost(), camera.skipped(), camera.damaged(),
             camera.disconnects());
  if (camera.damaged() > 0) {
    fmt::print(out,
               "             damaged: {} marked, {} without markers, {} short, {} undecodable\n",
               camera.damage().flagged(), camera.damage().markers(), camera.damage().too_short(),
               camera.damage().undecodable());
  }
  if (!camera.moved().empty()) fmt::print(out, "             {}\n", camera.moved());
  for (const auto& control : camera.controls()) {
    fmt::print(out, "             {} {}, {}{}\n", control.name(), control.value(),
               words_of(control), control.note().empty() ? "" : ": " + control.note());
  }
}

void print_calibration(const v1::Status& status, std::ostream& out) {
  if (!status.has_calibration()) {
    fmt::print(out, "calibration  none\n");
    return;
  }
  fmt::print(out, "calibration  {}\n", text_of(status.calibration()));
}

void print_endpoint(const v1::Endpoint& endpoint, std::ostream& out) {
  fmt::print(
      out, "listens      {}{}{}{}\n", endpoint.address(), endpoint.tls() ? ", TLS" : "",
      endpoint.token() ? ", token" : "",
      endpoint.insecure() ? ", INSECURE: every host that reaches it may connect or listen" : "");
  if (!endpoint.fingerprint().empty()) {
    fmt::print(out, "             fingerprint {}\n", endpoint.fingerprint());
  }
  if (endpoint.has_certificate_days()) {
    const int days = endpoint.certificate_days();
    fmt::print(out, "             certificate {}\n",
               days < 0 ? fmt::format("EXPIRED {} days ago: dtactctl cert makes a pair", -days)
                        : fmt::format("expires in {} days", days));
  }
}

void print(const v1::Status& status, std::ostream& out) {
  fmt::print(out, "state        {}\nhealth       {}\n", client::name_of(status.state()),
             status.health().empty()
                 ? "ok"
                 : fmt::format("{}", fmt::join(client::names_of(status.health()), ", ")));
  if (!status.advice().empty()) fmt::print(out, "advice       {}\n", status.advice());
  print_camera(status.camera(), out);
  fmt::print(out, "ring         {} {}\n", status.ring().backend(), status.ring().identity());
  if (!status.ring().message().empty())
    fmt::print(out, "             {}\n", status.ring().message());
  fmt::print(out, "light        {}\n", text_of(status.light()));
  print_calibration(status, out);
  if (status.has_reconstruction()) {
    fmt::print(out, "depth        {}\n", text_of(status.reconstruction()));
  }
  if (status.light_followed() != 0) {
    fmt::print(out, "reference    follows the light by {:+.2f} %\n", 100 * status.light_followed());
  }
  fmt::print(out, "frames       {} published, {} skipped, {} encoded, {:.1f} fps\n",
             status.frames(), status.skipped(), status.encoded(), status.fps());
  for (const auto& stage : status.stages()) {
    fmt::print(out, "  {:<10} p50 {:.0f} us, p99 {:.0f} us, max {:.0f} us\n", stage.stage(),
               stage.p50_us(), stage.p99_us(), stage.max_us());
  }
  const auto& usage = status.capture_thread();
  fmt::print(out,
             "capture      {}page faults {} minor, {} major; context switches {} waiting, {} "
             "preempted\n",
             status.has_capture_cpu() ? fmt::format("on CPU {}; ", status.capture_cpu()) : "",
             usage.minor_faults(), usage.major_faults(), usage.waits(), usage.preemptions());
  for (const auto& refused : status.realtime_refused())
    fmt::print(out, "realtime     {}\n", refused);
  for (const auto& endpoint : status.endpoints()) print_endpoint(endpoint, out);
  for (const auto& c : status.clients()) {
    fmt::print(out, "client       {} {}, sent {}, dropped {}{}\n", c.address(), c.program(),
               c.sent(), c.dropped(),
               c.rights() == v1::RIGHTS_VIEW      ? ", may view only"
               : c.rights() == v1::RIGHTS_CONTROL ? ", may not calibrate"
                                                  : "");
  }
  fmt::print(out, "version      {}, up {:.0f} s{}\n", status.version(), status.uptime_s(),
             status.has_board_celsius()
                 ? fmt::format(", board at {:.0f} °C", status.board_celsius())
                 : "");
}

}  // namespace

void add_status(CLI::App& app, Context& context) {
  auto* command =
      app.add_subcommand("status", "Show the daemon's state, health and what to do about it");
  cli::add_json_option(*command, context);
  command->callback([&context] {
    const auto status = client::Client(context.target).status();
    if (context.json) {
      context.out << cli::json_line(status);
    } else {
      print(cli::printable(status), context.out);
    }
  });
}

}  // namespace dtact::ctl
