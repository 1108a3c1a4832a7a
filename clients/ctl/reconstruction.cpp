#include <fmt/format.h>

#include <memory>
#include <optional>
#include <ostream>
#include <string>

#include "clients/common/json.hpp"
#include "clients/ctl/online.hpp"
#include "clients/ctl/reconstruction_text.hpp"

namespace dtact::ctl {
namespace {

struct ReconstructionOptions {
  std::optional<std::string> resolution;
  std::optional<std::string> sharpen;
  std::optional<double> max_error_um;
};

v1::Reconstruction run(const Context& context, const ReconstructionOptions& options) {
  client::Client client(context.target);
  if (!options.resolution && !options.sharpen && !options.max_error_um) {
    const v1::Status status = client.status();
    if (status.has_reconstruction()) return status.reconstruction();
    throw client::Refused(v1::ERROR_UNSUPPORTED,
                          "this daemon does not report its reconstruction: update dtactd");
  }
  v1::SetReconstruction change;
  if (options.resolution) change.set_resolution(*options.resolution);
  if (options.sharpen) change.set_sharpen(*options.sharpen);
  if (options.max_error_um) change.set_max_error_um(*options.max_error_um);
  return client.set_reconstruction(change);
}

}  // namespace

void add_reconstruction(CLI::App& app, Context& context) {
  auto* command = app.add_subcommand(
      "reconstruction",
      "Change how depth is made, speed against accuracy, until the daemon ends; without options, "
      "show it");
  const auto options = std::make_shared<ReconstructionOptions>();
  command->add_option("--resolution", options->resolution,
                      "The map's share of the calibration's resolution: full, half, quarter, or "
                      "auto: the coarsest within --max-error-um, for each frame");
  command->add_option("--sharpen", options->sharpen,
                      "Steps of sharpening against the gel's blur: off, 1, 2, or auto: the "
                      "fewest within --max-error-um, for each frame");
  command
      ->add_option("--max-error-um", options->max_error_um,
                   "What auto keeps to: expected error inside the contact, micrometres")
      ->check(cli::in_range(1.0, 10000.0));
  cli::add_json_option(*command, context);
  command->callback([&context, options] {
    const v1::Reconstruction how = run(context, *options);
    context.out << (context.json ? cli::json_line(how) : text_of(how) + '\n');
  });
}

}  // namespace dtact::ctl
