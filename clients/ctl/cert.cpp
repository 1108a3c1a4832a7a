#include <fmt/format.h>
#include <fmt/ranges.h>

#include <filesystem>
#include <memory>
#include <ostream>
#include <stdexcept>

#include "clients/ctl/certificate.hpp"
#include "clients/ctl/secrets.hpp"
#include "hal/base/atomic_file.hpp"

namespace dtact::ctl {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  fs::path folder;
  std::vector<std::string> names;
  bool force = false;
  fs::path show;
};

void show(const fs::path& file, std::ostream& out) {
  const std::string text = base::read_file(file, 1U << 20U);
  try {
    out << fingerprint_of(text) << '\n';
  } catch (const std::runtime_error& e) {
    throw std::runtime_error(fmt::format("{} {}", file.string(), e.what()));
  }
}

void make(const Arguments& arguments, std::ostream& out) {
  const fs::path folder = fs::absolute(arguments.folder);
  const fs::path certificate = folder / "dtactd.crt";
  const fs::path key = folder / "dtactd.key";
  for (const fs::path& file : {certificate, key}) {
    if (!arguments.force && fs::exists(fs::symlink_status(file))) {
      throw std::runtime_error(fmt::format(
          "{} is there already, and clients may pin it: --force replaces it", file.string()));
    }
  }
  std::vector<std::string> names = own_names();
  names.insert(names.begin(), arguments.names.begin(), arguments.names.end());
  const Pair pair = make_pair(names);
  fs::create_directories(folder);
  base::write_file_atomically(key, pair.key, 0600);
  base::write_file_atomically(certificate, pair.certificate);
  const std::string fingerprint = fingerprint_of(pair.certificate);
  out << fmt::format(
      "{}\n{}\nfor {}; good for ten years\n\n"
      "In the daemon's configuration, where its user must be the owner of the key:\n"
      "[net]\ntls_certificate = \"{}\"\ntls_key = \"{}\"\n\n"
      "Clients pin the fingerprint:\n--fingerprint {}\n",
      certificate.string(), key.string(), fmt::join(names, ", "), certificate.string(),
      key.string(), fingerprint);
}

}  // namespace

void add_cert(CLI::App& app, Context& context) {
  CLI::App* command =
      app.add_subcommand("cert", "Make the daemon's TLS certificate and key (needs no daemon)");
  const auto arguments = std::make_shared<Arguments>();
  auto* output = command
                     ->add_option("-o,--output", arguments->folder,
                                  "Folder to write dtactd.crt and dtactd.key to")
                     ->type_name("FOLDER");
  command->add_option("--name", arguments->names,
                      "Further host names and addresses that clients use, beside this machine's");
  command->add_flag("--force", arguments->force, "Replace a pair that is there");
  auto* shown =
      command
          ->add_option("--show", arguments->show, "Only print the fingerprint of this certificate")
          ->type_name("FILE")
          ->excludes(output);
  command->callback([arguments, shown, output, &context] {
    if (shown->count() > 0) return show(arguments->show, context.out);
    if (output->count() == 0) throw CLI::RequiredError("-o or --show");
    make(*arguments, context.out);
  });
}

}  // namespace dtact::ctl
