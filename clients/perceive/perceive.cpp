#include "clients/perceive/perceive.hpp"

#include <fmt/format.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/signal_set.hpp>
#include <memory>
#include <ostream>
#include <string>

#include "clients/common/listen_options.hpp"
#include "clients/perceive/object_file.hpp"
#include "clients/perceive/recognition/taught_objects.hpp"
#include "clients/perceive/server.hpp"
#include "clients/perceive/watch.hpp"
#include "daemon/serve/net_config.hpp"
#include "hal/base/utf8.hpp"
#include "version.hpp"

namespace dtact::perceive {
namespace {

struct Settings {
  net::NetConfig net;
  std::string object;  ///< A file; none: empty.
  std::string object_unit = "mm";
  std::string taught;  ///< A folder; none: empty.
};

void serve(const cli::Context& context, const Settings& settings) {
  net::NetConfig config = settings.net;
  config.program = "dtact-perceive " DTACT_VERSION;
  config.version = DTACT_VERSION;
  config.features = wire::kPerceiveFeatures;
  config.anonymous_rights = net::Rights::view;  // it takes no command
  // A line each, for a terminal and for the journal alike.
  config.log = [&out = context.out](const net::LogLine& line) {
    out << base::printable(line.text) << '\n' << std::flush;
  };
  std::shared_ptr<const ObjectModel> object;
  if (!settings.object.empty()) {
    object = load_object(settings.object, settings.object_unit);
    config.log(
        {net::LogLevel::info, fmt::format("following {}: {} places {:.2f} mm apart", object->name,
                                          object->surfels.size(), 1e3 * object->spacing)});
    if (object->spacing > kCoarse) {
      config.log({net::LogLevel::warning,
                  fmt::format("{} is large: its places are more than {} mm apart, and it may be "
                              "found where it is not; give only the part in contact",
                              object->name, 1e3 * kCoarse)});
    }
  }
  if (!settings.taught.empty()) {
    Network network;
    const auto taught = load_taught(network, settings.taught);
    config.log({net::LogLevel::info,
                fmt::format("{} taught objects in {}", taught.objects.size(), settings.taught)});
    for (const std::string& sentence : taught.damaged) {
      config.log({net::LogLevel::warning, sentence});
    }
  }
  boost::asio::io_context io;
  const auto server = std::make_shared<Server>(io, config, context.target, object, settings.taught);
  for (const std::string& address : server->addresses()) {
    config.log({net::LogLevel::info, "listening on " + address});
  }
  boost::asio::signal_set signals(io, SIGINT, SIGTERM);
  boost::asio::signal_set hangups(io, SIGHUP);
  cli::reload_at_hangup(hangups, config.log, [&] { server->reload(); });
  signals.async_wait([&](const auto& error, int) {
    if (error) return;
    hangups.cancel();
    server->stop();
  });
  server->start();
  io.run();
}

void add_serve(CLI::App& app, cli::Context& context) {
  auto* command = app.add_subcommand(
      "serve",
      "Serve point clouds and poses of the daemon's frames, until Ctrl-C or SIGTERM; SIGHUP reads "
      "certificate, key and tokens again");
  const auto settings = std::make_shared<Settings>();
  settings->net.port = wire::kPerceivePort;
  cli::add_listen_options(*command, settings->net);
  command
      ->add_option("--unix-socket", settings->net.unix_socket,
                   "A socket for clients on this machine, too")
      ->type_name("FILE");
  auto* object = command->add_option(
      "--object", settings->object,
      "The shape of the object in contact: poses are then its place in the sensor's frame, "
      "not the motion since first contact. STL, PLY with faces, or a PLY cloud with outward "
      "normals, of at most 64 MiB");
  object->type_name("FILE");
  command->add_option("--object-unit", settings->object_unit, "Of the lengths in that file")
      ->needs(object)
      ->check(CLI::IsMember({"mm", "m"}))
      ->capture_default_str();
  command
      ->add_option("--taught", settings->taught,
                   "Folder of objects to recognise beside the built-in ones, which dtact-calibrate "
                   "objects teaches; read again when it changes")
      ->type_name("FOLDER");
  command->callback([&context, settings] { serve(context, *settings); });
}

}  // namespace

void set_up(CLI::App& app, cli::Context& context) {
  app.name("dtact-perceive")
      ->description(
          "Outputs point clouds of the contact on a DTact tactile sensor and tracks its motion: "
          "from the frames of dtactd, on the same wire, only during contact.");
  cli::add_global_options(app, context);
  add_serve(app, context);
  add_watch(app, context);
}

int run(const std::vector<std::string>& arguments, std::ostream& out, std::ostream& error) {
  CLI::App app;
  cli::Context context{{}, false, out};
  set_up(app, context);
  return cli::run(app, arguments, out, error);
}

}  // namespace dtact::perceive
