#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <ostream>
#include <stdexcept>
#include <vector>

#include "clients/ctl/calibration_text.hpp"
#include "clients/ctl/json/json.hpp"
#include "clients/ctl/online.hpp"
#include "hal/base/atomic_file.hpp"
#include "hal/base/atomic_folder.hpp"

namespace dtact::ctl {
namespace {

namespace fs = std::filesystem;

constexpr const char* kToml = "calibration.toml";
constexpr const char* kPng = "reference.png";

/// One number, or none for the current calibration.
using Id = std::optional<std::uint64_t>;

/// Of the folder itself, also for "cal/" and ".".
std::string name_of(const fs::path& folder) {
  const fs::path path = fs::canonical(folder);
  return path.filename().string();
}

void print(const Context& context, Json& json) { context.out << json.close('}').text() << '\n'; }

/// "ball", and its id where the daemon says it.
std::string title_of(const client::CalibrationFiles& files) {
  return files.number ? fmt::format("{} ({})", files.name, id_of(*files.number)) : files.name;
}

/// An object with id (null when the daemon does not say it) and name, left open.
Json begin(const client::CalibrationFiles& files) {
  Json json;
  json.open('{').key("id");
  if (files.number) {
    json.value(id_of(*files.number));
  } else {
    json.null();
  }
  json.member("name", files.name);
  return json;
}

void upload(const Context& context, const fs::path& folder, const std::string& name) {
  client::CalibrationFiles files;
  files.name = name.empty() ? name_of(folder) : name;
  files.toml = base::read_file(folder / kToml);
  files.png = base::read_file(folder / kPng);
  files.number = client::Client(context.target).upload_calibration(files);
  if (context.json) {
    Json json = begin(files);
    print(context, json);
  } else {
    context.out << fmt::format("the daemon uses calibration {} from now on\n", title_of(files));
  }
}

/// What the table does not say when the calibration in use and the one to start with differ.
std::string difference_of(const std::vector<client::StoredCalibration>& calibrations,
                          client::Client& client) {
  using client::StoredCalibration;
  const auto current = std::ranges::find_if(calibrations, &StoredCalibration::current);
  const bool starts = current != calibrations.end();
  if (starts && current->in_use) return {};
  std::string text;
  if (std::ranges::none_of(calibrations, &StoredCalibration::in_use)) {
    const auto used = client.status().calibration;
    text = used ? fmt::format("in use is {}, under no number that the daemon knows\n", used->name)
                : "none is in use\n";
  }
  if (starts) text += fmt::format("the daemon starts with {} (>)\n", id_of(current->number));
  return text;
}

void list(const Context& context) {
  client::Client client(context.target);
  const auto calibrations = client.calibrations();
  if (context.json) {
    for (const auto& stored : calibrations) {
      Json json;
      add_stored(stored, json);
      context.out << json.text() << '\n';
    }
  } else if (calibrations.empty()) {
    context.out << "the daemon keeps no calibration: dtactctl calibration upload sends one\n"
                << difference_of(calibrations, client);
  } else {
    context.out << text_of(calibrations) << difference_of(calibrations, client);
  }
}

void show(const Context& context, const Id& id) {
  const auto files = client::Client(context.target).calibration(id);
  if (context.json) {
    Json json = begin(files);
    json.member("calibration_toml", files.toml).member("reference_png_bytes", files.png.size());
    print(context, json);
  } else {
    context.out << "# calibration " << title_of(files) << '\n' << files.toml;
  }
}

void activate(const Context& context, const std::string& id) {
  client::Client(context.target).activate_calibration(parse_id(id));
  if (context.json) {
    print(context, Json().open('{').member("id", id));
  } else {
    context.out << fmt::format("the daemon uses calibration {} from now on\n", id);
  }
}

void save(const Context& context, const Id& id, const fs::path& folder, bool force) {
  if (!force && fs::exists(fs::symlink_status(folder))) {
    throw std::runtime_error(folder.string() + " exists: name another folder, or add --force");
  }
  const auto files = client::Client(context.target).calibration(id);
  base::write_folder_atomically(folder, {{kPng, files.png}, {kToml, files.toml}}, {kToml, kPng},
                                "a calibration");
  if (context.json) {
    print(context, begin(files).member("folder", folder.string()));
  } else {
    context.out << fmt::format("{}: calibration {}\n", folder.string(), title_of(files));
  }
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

  auto* fetch = command->add_subcommand("export", "Save one as a calibration folder");
  add_id(fetch, which);
  fetch->add_option("-o,--output", options->folder, "The folder to write")->required();
  fetch->add_flag("--force", options->force, "Replace the calibration that is in the folder");
  fetch->callback(
      [&context, options] { save(context, options->number(), options->folder, options->force); });
}

}  // namespace dtact::ctl
