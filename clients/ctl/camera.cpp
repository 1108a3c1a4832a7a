#include <fmt/format.h>

#include <memory>
#include <optional>
#include <ostream>
#include <string>

#include "clients/common/json.hpp"
#include "clients/ctl/online.hpp"

namespace dtact::ctl {
namespace {

struct CameraOptions {
  std::optional<double> exposure_us;
  std::optional<double> gain;
};

std::string text_of(const v1::CameraSettings& settings) {
  if (!settings.has_exposure_us() && !settings.has_gain()) {
    return "this camera has neither an exposure nor a gain that can be changed";
  }
  const auto line = [](const char* name, bool has, const v1::CameraSetting& setting,
                       const char* unit) {
    if (!has) return fmt::format("{:<9} none", name);
    return fmt::format("{:<9} {:g}{} ({:g} to {:g})", name, setting.value(), unit,
                       setting.minimum(), setting.maximum());
  };
  return line("exposure", settings.has_exposure_us(), settings.exposure_us(), " µs") + '\n' +
         line("gain", settings.has_gain(), settings.gain(), "");
}

void run_camera(const Context& context, const CameraOptions& options) {
  client::Client client(context.target);
  v1::SetCamera change;
  if (options.exposure_us) change.set_exposure_us(*options.exposure_us);
  if (options.gain) change.set_gain(*options.gain);
  const bool changes = options.exposure_us || options.gain;
  const v1::CameraSettings now =
      changes ? client.set_camera(change) : client.status().camera().settings();
  context.out << (context.json ? cli::json_line(now) : text_of(now) + '\n');
}

}  // namespace

void add_camera(CLI::App& app, Context& context) {
  auto* command = app.add_subcommand(
      "camera",
      "Change the camera's exposure and gain until the daemon ends; without options, show "
      "them. The reference is taken anew: nothing may touch the gel meanwhile");
  const auto options = std::make_shared<CameraOptions>();
  command->add_option("--exposure", options->exposure_us, "Microseconds")->check(cli::positive());
  command->add_option("--gain", options->gain, "In the camera's own unit")
      ->check(cli::in_range(0, 100000));
  cli::add_json_option(*command, context);
  command->callback([&context, options] { run_camera(context, *options); });
}

}  // namespace dtact::ctl
