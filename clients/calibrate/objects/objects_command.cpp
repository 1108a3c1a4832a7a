#include "clients/calibrate/objects/objects_command.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <stdio.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <memory>
#include <ostream>
#include <stdexcept>
#include <string>
#include <system_error>

#include "clients/calibrate/guided/console.hpp"
#include "clients/calibrate/objects/evaluation.hpp"
#include "clients/calibrate/objects/teaching.hpp"
#include "clients/common/guided.pb.h"
#include "clients/common/interruptible.hpp"
#include "clients/common/json.hpp"
#include "clients/perceive/recognition/taught_objects.hpp"
#include "hal/base/utf8.hpp"

namespace dtact::objects {
namespace {

namespace fs = std::filesystem;

struct Options {
  std::string folder;
  std::string name;
  std::string new_name;
  int presses = 10;
};

void check_known(const Options& options) {
  const auto names = perceive::taught_names(options.folder);
  if (std::ranges::count(names, options.name) > 0) return;
  throw std::runtime_error(fmt::format("{} holds no object {}; it holds: {}", options.folder,
                                       options.name, fmt::join(names, ", ")));
}

void run_lesson(const Options& options, const cli::Context& context) {
  const cli::Interruptible interruptible;
  const auto console = ctl::guided::make_console(context);
  teach({options.folder, options.name, options.presses}, context.target, *console);
}

void list(const Options& options, const cli::Context& context) {
  cli::GuidedLine line;
  for (const std::string& name : perceive::taught_names(options.folder)) {
    cli::TaughtObject& object = *line.mutable_taught()->add_objects();
    object.set_name(base::as_utf8(name));
    try {
      object.set_presses(
          static_cast<std::uint32_t>(perceive::read_presses(options.folder, name).size()));
    } catch (const std::runtime_error& e) {
      object.set_damage(e.what());
    }
    if (context.json) continue;
    context.out << (object.damage().empty()
                        ? fmt::format("{}: {} presses\n", object.name(), object.presses())
                        : fmt::format("{}: damaged: {}\n", object.name(), object.damage()));
  }
  if (context.json) context.out << cli::json_line(line);
}

void rename(const Options& options) {
  check_known(options);
  perceive::check_name(options.new_name);
  if (options.new_name == options.name) return;
  const fs::path from = perceive::file_of(options.folder, options.name);
  const fs::path to = perceive::file_of(options.folder, options.new_name);
  // In one step: a lesson, or another rename, may store that name at the same time.
  if (::renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), RENAME_NOREPLACE) == 0) return;
  const int error = errno;
  if (error == EEXIST || (error == EINVAL && fs::exists(to))) {
    throw std::runtime_error(fmt::format("{} exists already: forget it first", options.new_name));
  }
  if (error != EINVAL) {
    throw std::system_error(error, std::generic_category(), "cannot rename " + from.string());
  }
  fs::rename(from, to);  // the file system knows no such step
}

void forget(const Options& options) {
  check_known(options);
  const fs::path file = perceive::file_of(options.folder, options.name);
  if (fs::is_directory(file) && !fs::is_empty(file)) {
    throw std::runtime_error(
        fmt::format("{} is a folder and not empty: remove it yourself", file.string()));
  }
  fs::remove(file);
}

}  // namespace

void add_objects(CLI::App& app, cli::Context& context) {
  CLI::App* objects = app.add_subcommand(
      "objects", "Teach dtact-perceive objects by pressing them, and manage those");
  objects->require_subcommand(1);
  const auto options = std::make_shared<Options>();
  const auto add = [objects, options](const char* name, const char* description) {
    CLI::App* command = objects->add_subcommand(name, description);
    command
        ->add_option("--taught", options->folder,
                     "Folder of taught objects, the one that dtact-perceive serve --taught reads")
        ->type_name("FOLDER")
        ->required();
    return command;
  };
  auto* teach_command =
      add("teach", "Take presses of an object from the running daemon; replaces earlier ones");
  teach_command->add_option("NAME", options->name, "Name of the object")->required();
  teach_command->add_option("--presses", options->presses, "Number of presses")
      ->capture_default_str()
      ->check(CLI::Range(3, 100));
  cli::add_json_option(*teach_command, context);
  teach_command->callback([&context, options] { run_lesson(*options, context); });
  auto* list_command = add("list", "List the taught objects");
  cli::add_json_option(*list_command, context);
  list_command->callback([&context, options] { list(*options, context); });
  auto* rename_command = add("rename", "Give a taught object another name");
  rename_command->add_option("NAME", options->name, "Its name")->required();
  rename_command->add_option("NEW", options->new_name, "Its new name")->required();
  rename_command->callback([options] { rename(*options); });
  auto* forget_command = add("forget", "Remove a taught object");
  forget_command->add_option("NAME", options->name, "Its name")->required();
  forget_command->callback([options] { forget(*options); });
  const auto plan = std::make_shared<EvaluationPlan>();
  CLI::App* evaluate_command = objects->add_subcommand(
      "evaluate",
      "Say how well objects can be distinguished, on recordings or depth maps of their presses");
  evaluate_command
      ->add_option("FOLDER", plan->folder,
                   "Holds NAME/*.mcap, whose contacts are a press each, and NAME/*.npy, a press "
                   "each; NAME/OBJECT/ where several objects have one name")
      ->required();
  evaluate_command
      ->add_option("--mm-per-px", plan->mm_per_px, "Scale of the .npy files' depth maps")
      ->check(cli::in_range(0.001, perceive::TouchMap::kCellMm));
  evaluate_command
      ->add_option("-o,--output", plan->picture, "The confusion table as a picture (PNG)")
      ->type_name("FILE");
  evaluate_command->callback([&context, plan] { evaluate(*plan, context.out); });
}

}  // namespace dtact::objects
