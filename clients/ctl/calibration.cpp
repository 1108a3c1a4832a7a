#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <ostream>

#include "clients/ctl/json/json.hpp"
#include "clients/ctl/online.hpp"
#include "hal/base/atomic_file.hpp"

namespace dtact::ctl {
namespace {

namespace fs = std::filesystem;

constexpr const char* kToml = "calibration.toml";
constexpr const char* kPng = "reference.png";

/// Of the folder itself, also for "cal/" and ".".
std::string name_of(const fs::path& folder) {
  const fs::path path = fs::canonical(folder);
  return path.filename().string();
}

void upload(const Context& context, const fs::path& folder, const std::string& name) {
  client::CalibrationFiles files;
  files.name = name.empty() ? name_of(folder) : name;
  files.toml = base::read_file(folder / kToml);
  files.png = base::read_file(folder / kPng);
  client::Client(context.target).upload_calibration(files);
  if (context.json) {
    context.out << Json().open('{').member("name", files.name).close('}').text() << '\n';
  } else {
    context.out << fmt::format("the daemon uses calibration {} from now on\n", files.name);
  }
}

void show(const Context& context, const fs::path& folder) {
  const auto files = client::Client(context.target).calibration();
  if (!folder.empty()) {
    fs::create_directories(folder);
    base::write_file_atomically(folder / kToml, files.toml);
    base::write_file_atomically(folder / kPng, files.png);
  }
  if (context.json) {
    context.out << Json()
                       .open('{')
                       .member("name", files.name)
                       .member("calibration_toml", files.toml)
                       .member("reference_png_bytes", files.png.size())
                       .close('}')
                       .text()
                << '\n';
  } else {
    context.out << "# calibration " << files.name << '\n' << files.toml;
  }
}

}  // namespace

void add_calibration(CLI::App& app, Context& context) {
  auto* command = app.add_subcommand("calibration", "Send or fetch the daemon's calibration");
  command->require_subcommand(1);

  struct Options {
    std::string folder;
    std::string name;
    std::string output;
  };
  const auto options = std::make_shared<Options>();
  auto* send = command->add_subcommand("upload", "Send a calibration folder; it is used at once");
  send->add_option("FOLDER", options->folder, "With calibration.toml and reference.png")
      ->required()
      ->check(CLI::ExistingDirectory);
  send->add_option("--name", options->name, "Its name at the daemon (default: the folder's)");
  send->callback([&context, options] { upload(context, options->folder, options->name); });

  auto* fetch = command->add_subcommand("show", "Print the calibration in use");
  fetch->add_option("-o,--output", options->output, "Also save it as this folder");
  fetch->callback([&context, options] { show(context, options->output); });
}

}  // namespace dtact::ctl
