#include "clients/web/web.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/signal_set.hpp>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <ostream>
#include <thread>

#include "clients/common/avahi.hpp"
#include "clients/common/daemon_option.hpp"
#include "clients/common/listen_options.hpp"
#include "clients/web/names.hpp"
#include "clients/web/page.hpp"
#include "clients/web/server.hpp"
#include "daemon/serve/security.hpp"
#include "hal/base/free_memory.hpp"
#include "hal/base/utf8.hpp"
#include "version.hpp"

namespace dtact::web {
namespace {

/// What the command line says.
struct Arguments {
  Settings settings;
  std::vector<std::string> daemons;
  std::filesystem::path page;
  std::optional<net::Rights> anonymous_rights;
};

void serve(const cli::Context& context, const Arguments& arguments) {
  base::keep_little_memory();
  Settings settings = arguments.settings;
  settings.daemons = cli::parse_daemons("--daemon", arguments.daemons, context.target);
  if (settings.daemons.empty() && !settings.find) settings.daemons = {{"sensor", context.target}};
  if (settings.taught.empty()) settings.taught = settings.work_folder / "objects";
  for (std::string& name : machine_names()) settings.host_names.push_back(std::move(name));
  net::NetConfig& config = settings.net;
  config.program = "dtact-web " DTACT_VERSION;
  config.version = DTACT_VERSION;
  config.anonymous_rights = arguments.anonymous_rights.value_or(
      net::reaches_beyond(config) ? net::Rights::view : net::Rights::calibrate);
  // A line each, for a terminal and for the journal alike.
  config.log = [&out = context.out](const net::LogLine& line) {
    out << base::printable(line.text) << '\n' << std::flush;
  };
  const auto page =
      arguments.page.empty() ? std::make_unique<Page>() : std::make_unique<Page>(arguments.page);
  boost::asio::io_context io(1);  // one thread runs it
  const auto server = std::make_shared<Server>(io, settings, *page);
  config.log({net::LogLevel::info, "listening on " + server->address()});
  boost::asio::signal_set signals(io, SIGINT, SIGTERM);
  signals.async_wait([&](const auto& error, int) {
    if (error) return;
    server->stop();
    // Connections of HTTP are not waited for.
    io.stop();
  });
  boost::asio::signal_set hangups(io, SIGHUP);
  cli::reload_at_hangup(hangups, config.log, [&] { server->reload(); });
  server->start();
  std::jthread finder;
  if (settings.find) {
    finder = cli::watch_network(
        context.target, settings.daemons,
        [&](cli::Finder::Found found) {
          boost::asio::post(io, [server, found = std::move(found)] { server->add(found); });
        },
        [&](const std::string& line) {
          boost::asio::post(io, [&config, line] { config.log({net::LogLevel::warning, line}); });
        });
  }
  io.run();
}

}  // namespace

void set_up(CLI::App& app, cli::Context& context) {
  app.name("dtact-web")
      ->description(
          "Shows DTact tactile sensors in a browser, and steers them: a client of any number of "
          "dtactd, and a server of a page and of WebSockets that carry the daemons' own wire.\n"
          "Serves until Ctrl-C or SIGTERM; SIGHUP reads certificate, key and tokens again.");
  cli::add_global_options(app, context);
  app.require_subcommand(0);
  const auto arguments = std::make_shared<Arguments>();
  net::NetConfig& net = arguments->settings.net;
  net.port = wire::kWebPort;
  net.max_clients = 64;
  net.max_clients_per_address = 48;
  arguments->settings.work_folder = "dtact-calibrations";
  cli::add_daemon_option(app, arguments->daemons, "on the page");
  cli::add_find_option(app, arguments->settings.find);
  cli::add_listen_options(app, net);
  CLI::CheckedTransformer rights(
      std::map<std::string, net::Rights>{{"view", net::Rights::view},
                                         {"control", net::Rights::control},
                                         {"calibrate", net::Rights::calibrate}});
  rights.description("");  // the type's name says them
  app.add_option("--anonymous-rights", arguments->anonymous_rights,
                 "What viewers may do where there are no --tokens; by default calibrate for "
                 "viewers on this machine, view where --listen reaches beyond it")
      ->transform(rights)
      ->type_name("view|control|calibrate");
  app.add_option("--name", arguments->settings.host_names,
                 "A name by which browsers may reach this machine, besides its own and its "
                 "addresses")
      ->type_name("HOST")
      ->take_all();
  app.add_option("--foxglove-origin", arguments->settings.foxglove_origins,
                 "An address whose pages may open /foxglove, such as http://localhost:8080 or "
                 "https://app.foxglove.dev; programs on the desktop always may")
      ->type_name("ORIGIN")
      ->take_all();
  app.add_option("--work-folder", arguments->settings.work_folder,
                 "Below it guided calibrations save what they take")
      ->type_name("FOLDER")
      ->envname("STATE_DIRECTORY")
      ->capture_default_str();
  app.add_option("--taught", arguments->settings.taught,
                 "Folder of the objects that are taught on the page, the one that dtact-perceive "
                 "serve --taught reads; by default objects below the --work-folder")
      ->type_name("FOLDER");
  app.add_option("--page", arguments->page,
                 "Serve the files of this folder in place of the page that is built in")
      ->type_name("FOLDER");
  app.callback([&context, arguments] { serve(context, *arguments); });
}

int run(const std::vector<std::string>& arguments, std::ostream& out, std::ostream& error) {
  CLI::App app;
  cli::Context context{{}, false, out};
  set_up(app, context);
  return cli::run(app, arguments, out, error);
}

}  // namespace dtact::web
