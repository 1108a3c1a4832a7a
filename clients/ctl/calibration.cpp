#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <ostream>
#include <stdexcept>
#include <vector>

#include "clients/common/json.hpp"
#include "clients/common/printable.hpp"
#include "clients/common/reports.pb.h"
#include "clients/ctl/calibration_text.hpp"
#include "clients/ctl/online.hpp"
#include "hal/base/atomic_file.hpp"

namespace dtact::ctl {
namespace {

namespace fs = std::filesystem;

constexpr const char* kToml = "calibration.toml";
constexpr const char* kPng = "reference.png";

/// One number, or none for the current calibration.
using Id = std::optional<std::uint64_t>;

/// Name of the folder itself, also for "cal/" and ".".
std::string name_of(const fs::path& folder) {
  const fs::path path = fs::canonical(folder);
  return path.filename().string();
}

/// "ball", and its id where the daemon says it.
std::string title_of(const std::string& name, const Id& number) {
  return number ? fmt::format("{} ({})", name, id_of(*number)) : name;
}

Id number_of(const v1::CalibrationFiles& files) {
  return files.has_number() ? Id(files.number()) : Id();
}

void print_json(const Context& context, const std::string& name, const Id& number,
                const std::string& folder = {}, const v1::Done* done = nullptr) {
  cli::CalibrationReport report;
  if (number) report.set_number(*number);
  report.set_name(name);
  report.set_folder(folder);
  if (done != nullptr) {
    for (const v1::StoredCalibration& old : done->removed()) report.add_removed(old.number());
  }
  context.out << cli::json_line(report);
}

void upload(const Context& context, const fs::path& folder, const std::string& name) {
  const v1::UploadCalibration files = read_calibration(folder, name);
  const v1::Done done = client::Client(context.target).upload_calibration(files);
  const Id number = done.has_calibration() ? Id(done.calibration()) : Id();
  if (context.json) return print_json(context, files.name(), number, {}, &done);
  context.out << fmt::format("the daemon uses calibration {} from now on\n",
                             title_of(files.name(), number));
  for (const v1::StoredCalibration& old : done.removed()) {
    context.out << fmt::format("it removed {}: the ten used last stay, and pinned ones\n",
                               title_of(old.name(), old.number()));
  }
}

/// What the table does not say when the calibration in use and the one to start with differ.
std::string difference_of(const std::vector<v1::StoredCalibration>& calibrations,
                          client::Client& client) {
  using v1::StoredCalibration;
  const auto current = std::ranges::find_if(calibrations, &StoredCalibration::current);
  const bool starts = current != calibrations.end();
  if (starts && current->in_use()) return {};
  std::string text;
  if (std::ranges::none_of(calibrations, &StoredCalibration::in_use)) {
    const v1::Status status = client.status();
    text = status.has_calibration()
               ? fmt::format("in use is {}, under no number that the daemon knows\n",
                             status.calibration().name())
               : "none is in use\n";
  }
  if (starts) text += fmt::format("the daemon starts with {} (>)\n", id_of(current->number()));
  return text;
}

void list(const Context& context) {
  client::Client client(context.target);
  auto calibrations = client.calibrations();
  if (context.json) {
    for (const auto& stored : calibrations) context.out << cli::json_line(stored);
    return;
  }
  for (auto& stored : calibrations) cli::make_printable(stored);
  if (calibrations.empty()) {
    context.out << "the daemon keeps no calibration: dtactctl calibration upload sends one\n"
                << difference_of(calibrations, client);
  } else {
    context.out << text_of(calibrations) << difference_of(calibrations, client);
  }
}

void show(const Context& context, const Id& id) {
  const v1::CalibrationFiles files = client::Client(context.target).calibration(id);
  context.out << (context.json ? cli::json_line(files)
                               : "# calibration " + title_of(files.name(), number_of(files)) +
                                     '\n' + files.calibration_toml());
}

void activate(const Context& context, const std::string& id) {
  const std::uint64_t number = parse_id(id);
  client::Client(context.target).activate_calibration(number);
  if (context.json) return print_json(context, {}, number);
  context.out << fmt::format("the daemon uses calibration {} from now on\n", id);
}

void pin(const Context& context, const std::string& id, bool pinned) {
  const std::uint64_t number = parse_id(id);
  client::Client(context.target).pin_calibration(number, pinned);
  if (context.json) return print_json(context, {}, number);
  context.out << fmt::format("calibration {} {}\n", id,
                             pinned ? "stays until it is unpinned" : "is pinned no more");
}

void save(const Context& context, const Id& id, const fs::path& folder, bool force) {
  if (!force && fs::exists(fs::symlink_status(folder))) {
    throw std::runtime_error(folder.string() + " exists: name another folder, or add --force");
  }
  const v1::CalibrationFiles files = client::Client(context.target).calibration(id);
  base::write_folder_atomically(folder,
                                {{kPng, files.reference_png()}, {kToml, files.calibration_toml()}},
                                {kToml, kPng}, "a calibration");
  const Id number = number_of(files);
  if (context.json) return print_json(context, files.name(), number, folder.string());
  context.out << fmt::format("{}: calibration {}\n", folder.string(),
                             title_of(files.name(), number));
}

std::string check_id(const std::string& text) {
  try {
    (void)parse_id(text);
    return {};
  } catch (const std::invalid_argument& e) {
    return e.what();
  }
}

}  // namespace

v1::UploadCalibration read_calibration(const fs::path& folder, const std::string& name) {
  v1::UploadCalibration files;
  files.set_name(name.empty() ? name_of(folder) : name);
  files.set_calibration_toml(base::read_file(folder / kToml));
  files.set_reference_png(base::read_file(folder / kPng));
  return files;
}

void add_calibration(CLI::App& app, Context& context) {
  auto* command = app.add_subcommand("calibration", "The daemon's calibrations");
  command->require_subcommand(1);

  struct Options {
    std::string folder;
    std::string name;
    std::string id;
    bool force = false;
    [[nodiscard]] Id number() const { return id.empty() ? Id() : Id(parse_id(id)); }
  };
  const auto options = std::make_shared<Options>();
  const auto add_id = [&options](CLI::App* verb, const std::string& help) {
    return verb->add_option("ID", options->id, help)->check(check_id);
  };

  auto* send = command->add_subcommand("upload", "Send a calibration folder; it is used at once");
  send->add_option("FOLDER", options->folder, "With calibration.toml and reference.png")
      ->required()
      ->check(CLI::ExistingDirectory);
  send->add_option("--name", options->name, "Its name at the daemon (default: the folder's)");
  send->callback([&context, options] { upload(context, options->folder, options->name); });

  command
      ->add_subcommand("list",
                       "List them: the one the configuration names and the uploaded ones; * marks "
                       "the one in use, > the one to start with where that is another one")
      ->callback([&context] { list(context); });

  const std::string which = "As in the list (default: the current one)";
  auto* print_one = command->add_subcommand("show", "Print one");
  add_id(print_one, which);
  print_one->callback([&context, options] { show(context, options->number()); });

  auto* use = command->add_subcommand(
      "activate",
      "Use one at once and from every start on; \"configured\" goes back to the "
      "configuration's");
  add_id(use, "As in the list")->required();
  use->callback([&context, options] { activate(context, options->id); });

  auto* keep = command->add_subcommand("pin", "Keep one, whatever is uploaded later");
  add_id(keep, "As in the list")->required();
  keep->callback([&context, options] { pin(context, options->id, true); });
  auto* unpin =
      command->add_subcommand("unpin", "Let it be removed again, once ten others were used");
  add_id(unpin, "As in the list")->required();
  unpin->callback([&context, options] { pin(context, options->id, false); });

  auto* fetch = command->add_subcommand("download", "Save one as a calibration folder");
  add_id(fetch, which);
  fetch->add_option("-o,--output", options->folder, "The folder to write")
      ->type_name("FOLDER")
      ->required();
  fetch->add_flag("--force", options->force, "Replace the calibration that is in the folder");
  for (CLI::App* verb : command->get_subcommands({})) cli::add_json_option(*verb, context);
  fetch->callback(
      [&context, options] { save(context, options->number(), options->folder, options->force); });
}

}  // namespace dtact::ctl
