#pragma once

#include <filesystem>
#include <string>

#include "clients/common/program.hpp"

// The commands that talk to a running daemon. Each add_…() adds its command to `app`; the command
// runs while the command line is parsed and throws what goes wrong.
namespace dtact::ctl {

using cli::Context;

void add_status(CLI::App& app, Context& context);
void add_setup(CLI::App& app, Context& context);
void add_watch(CLI::App& app, Context& context);
void add_bench(CLI::App& app, Context& context);
void add_find(CLI::App& app, Context& context);
void add_fleet(CLI::App& app, Context& context);
void add_led(CLI::App& app, Context& context);
void add_camera(CLI::App& app, Context& context);
void add_rezero(CLI::App& app, Context& context);
void add_reconstruction(CLI::App& app, Context& context);
void add_snapshot(CLI::App& app, Context& context);
void add_calibration(CLI::App& app, Context& context);
void add_record(CLI::App& app, Context& context);

/// The files of a calibration folder, to send; without a name they have the folder's.
[[nodiscard]] v1::UploadCalibration read_calibration(const std::filesystem::path& folder,
                                                     const std::string& name);

}  // namespace dtact::ctl
