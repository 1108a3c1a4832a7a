#include "clients/dds/dds.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <chrono>
#include <csignal>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <ostream>
#include <stdexcept>
#include <thread>
#include <utility>

#include "clients/common/avahi.hpp"
#include "clients/common/daemon_option.hpp"
#include "clients/common/interruptible.hpp"
#include "clients/dds/graph.hpp"
#include "clients/dds/recorder.hpp"
#include "clients/dds/ros2.h"
#include "clients/dds/sensor.hpp"
#include "hal/base/utf8.hpp"
#include "proto/defaults.hpp"

namespace dtact::dds {
namespace {

using Clock = std::chrono::steady_clock;

/// What the command line says.
struct Arguments {
  Graph::Config graph;
  Settings settings;
  std::vector<std::string> daemons;
  std::vector<std::string> perceives;
  bool read_only = false;
  bool commands = false;
  std::string record;
  bool force = false;
  double seconds = 0;
  bool find = false;
};

/// A name becomes part of topics, which ROS 2 allows less than dtact-web does.
void check_name(const std::string& name) {
  const bool starts_well = std::isdigit(static_cast<unsigned char>(name.front())) == 0;
  if (starts_well && name.find('-') == std::string::npos && name.find("__") == std::string::npos &&
      name.back() != '_') {
    return;
  }
  throw std::runtime_error(fmt::format(
      "--daemon {}: ROS 2 allows letters, digits and single '_' in a name, which does not begin "
      "with a digit and does not end with '_': choose another",
      name));
}

class Program {
 public:
  Program(const cli::Context& context, const Arguments& arguments)
      : out_(context.out),
        interfaces_(arguments.graph.interfaces),
        addresses_(present_addresses()),
        graph_(arguments.graph) {
    std::vector<cli::NamedDaemon> daemons =
        cli::parse_daemons("--daemon", arguments.daemons, context.target);
    if (daemons.empty() && !arguments.find) daemons = {{"sensor", context.target}};
    std::map<std::string, client::Options> perceives;
    client::Options perceive_at = context.target;
    perceive_at.port = wire::kPerceivePort;
    for (auto& [name, options] :
         cli::parse_daemons("--perceive", arguments.perceives, perceive_at)) {
      perceives[name] = std::move(options);
    }
    settings_ = arguments.settings;
    settings_.commands =
        arguments.commands || (!arguments.read_only && arguments.graph.interfaces.empty());
    const std::size_t node = graph_.add_node("/", "dtact_dds");
    transforms_ =
        graph_.add_writer(node, "/tf_static", tf2_msgs_msg_dds__TFMessage__desc, Qos::latched);
    diagnostics_ = graph_.add_writer(node, "/diagnostics",
                                     diagnostic_msgs_msg_dds__DiagnosticArray__desc, Qos::command);
    for (const cli::NamedDaemon& daemon : daemons) {
      check_name(daemon.name);
      const auto found = perceives.find(daemon.name);
      std::optional<client::Options> perceive;
      if (found != perceives.end()) perceive = std::move(perceives.extract(found).mapped());
      add(daemon, perceive);
    }
    if (!perceives.empty()) {
      throw std::runtime_error(
          fmt::format("--perceive {}: no --daemon has that name", perceives.begin()->first));
    }
    announce();
    if (!arguments.record.empty()) {
      recorder_.emplace(graph_, arguments.record, arguments.force);
      log("recording to " + arguments.record);
      if (arguments.seconds > 0) {
        end_ = Clock::now() +
               std::chrono::milliseconds(static_cast<std::int64_t>(arguments.seconds * 1e3));
      }
    }
    log(fmt::format("on DDS domain {}, {}, {}", arguments.graph.domain,
                    arguments.graph.interfaces.empty()
                        ? "this machine only"
                        : fmt::format("{}", fmt::join(arguments.graph.interfaces, ", ")),
                    settings_.commands ? "commands are taken" : "read only"));
    if (arguments.find) {
      finder_ = cli::watch_network(
          context.target, daemons,
          [this](cli::Finder::Found one) {
            if (!one.refused.empty()) return log(one.refused);
            const std::lock_guard lock(mutex_);
            found_.push_back(std::move(one.daemon));
          },
          [this](const std::string& line) { log(line); });
    }
  }

  /// Until interrupted; returns true earlier when the machine or the interfaces have had other
  /// addresses than at the start, and have some.
  bool run() {
    auto next_second = Clock::now();
    for (;;) {
      if (cli::Interruptible::happened() || Clock::now() > end_ ||
          (recorder_ && recorder_->failed()))
        break;
      graph_.wait(std::chrono::milliseconds(50));
      for (Sensor& sensor : sensors_) {
        sensor.take_commands();
        sensor.follow_subscribers();
      }
      if (Clock::now() < next_second) continue;
      next_second += std::chrono::seconds(1);
      add_found();
      const bool diagnostics = has_subscriber(diagnostics_);
      std::vector<Diagnosis> all;
      for (Sensor& sensor : sensors_) {
        if (diagnostics) all.push_back(sensor.diagnosis());
        sensor.each_second(diagnostics);
      }
      if (diagnostics) write_diagnostics(diagnostics_, ros_now(), all);
      const std::vector<std::string> present = present_addresses();
      moved_ |= present != addresses_;
      // A recording goes on in its file.
      if (moved_ && !present.empty() && !recorder_) {
        log("the machine's addresses have changed: joining the graph again");
        return true;
      }
    }
    if (recorder_) {
      const std::uint64_t messages = recorder_->finish();
      const std::uint64_t lost = recorder_->lost();
      log(fmt::format("{} messages recorded{}", messages,
                      lost == 0 ? "" : fmt::format("; {} lost because the disk is slow", lost)));
    }
    return false;
  }

 private:
  [[nodiscard]] std::vector<std::string> present_addresses() const {
    return interfaces_.empty() ? own_addresses() : addresses_of(interfaces_);
  }

  void add(const cli::NamedDaemon& daemon, const std::optional<client::Options>& perceive) {
    sensors_.emplace_back(graph_, daemon, perceive, settings_,
                          [this](const std::string& line) { log(line); });
  }

  /// Leaves out a daemon that no thread or descriptor is left for: any machine in the network can
  /// announce any number of them.
  void try_to_add(const cli::NamedDaemon& found) {
    const std::size_t nodes = graph_.nodes();
    try {
      add(found, {});
    } catch (const std::exception& e) {
      graph_.keep_nodes(nodes);
      log(fmt::format("{} at {}:{} is left out: {}", found.name, found.options.host,
                      found.options.port, e.what()));
    }
  }

  void announce() {
    std::vector<std::string> names;
    names.reserve(sensors_.size());
    for (const Sensor& sensor : sensors_) names.push_back(sensor.name());
    write_transforms(transforms_, ros_now(), names);
    graph_.announce();
  }

  void add_found() {
    std::vector<cli::NamedDaemon> found;
    {
      const std::lock_guard lock(mutex_);
      found.swap(found_);
    }
    const std::size_t before = sensors_.size();
    for (const cli::NamedDaemon& one : found) {
      const auto known = std::ranges::find(sensors_, one.name, &Sensor::name);
      if (known == sensors_.end()) {
        try_to_add(one);
      } else {
        log(fmt::format("{} is at {}:{} now", one.name, one.options.host, one.options.port));
        known->use(one.options);
      }
    }
    if (sensors_.size() > before) announce();
  }

  /// A line each, for a terminal and for the journal alike.
  void log(const std::string& line) {
    const std::lock_guard lock(mutex_);
    out_ << base::printable(line) << '\n' << std::flush;
  }

  std::ostream& out_;
  std::mutex mutex_;                     ///< Guards `out_` and `found_`.
  std::vector<std::string> interfaces_;  ///< None: not beyond this machine.
  std::vector<std::string> addresses_;   ///< At the start.
  bool moved_ = false;                   ///< They have been others since.
  Settings settings_;
  Graph graph_;
  dds_entity_t transforms_ = 0;
  dds_entity_t diagnostics_ = 0;
  std::deque<Sensor> sensors_;  ///< Their threads use the others.
  std::optional<Recorder> recorder_;
  Clock::time_point end_ = Clock::time_point::max();
  std::vector<cli::NamedDaemon> found_;  ///< New ones.
  std::jthread finder_;                  ///< Last: it uses the others.
};

}  // namespace

void set_up(CLI::App& app, cli::Context& context) {
  app.name("dtact-dds")
      ->description(
          "Puts DTact tactile sensors on a ROS 2 graph over DDS, without an installed ROS: a "
          "client of any number of dtactd. Topics under /NAME are listed in "
          "/usr/share/doc/dtact-dds.\n"
          "Runs until Ctrl-C or SIGTERM.");
  cli::add_global_options(app, context);
  app.require_subcommand(0);
  const auto arguments = std::make_shared<Arguments>();
  cli::add_daemon_option(app, arguments->daemons, "on the graph");
  CLI::Option* const find = cli::add_find_option(app, arguments->find);
  app.add_option("--perceive", arguments->perceives,
                 "The dtact-perceive of a sensor, which then has object_pose and recognition; "
                 "options as of --daemon; port 7378 unless named")
      ->type_name("NAME=ADDRESS")
      ->take_all();
  app.add_option("--domain", arguments->graph.domain, "DDS domain")
      ->envname("ROS_DOMAIN_ID")
      ->check(CLI::Range(0, 232))
      ->capture_default_str();
  CLI::Option* const interface =
      app.add_option(
             "--interface", arguments->graph.interfaces,
             "Network interface, by name or address, to leave this machine through. "
             "Everybody in that network can then subscribe: DDS Security is not in Debian's "
             "Cyclone DDS")
          ->type_name("NAME")
          ->take_all();
  app.add_option("--peer", arguments->graph.peers,
                 "Another machine to look for participants on, where multicast does not reach it")
      ->type_name("ADDRESS")
      ->take_all()
      ->needs(interface);
  CLI::Option* const read_only =
      app.add_flag("--read-only", arguments->read_only,
                   "Take no commands from the graph, which is the default with --interface");
  app.add_flag("--commands", arguments->commands, "Take commands with --interface, too")
      ->excludes(read_only);
  CLI::CheckedTransformer resolutions(
      std::map<std::string, std::uint32_t>{{"full", 1}, {"half", 2}, {"quarter", 4}});
  resolutions.description("");  // the type's name says them
  app.add_option("--image", arguments->settings.decimation,
                 "Resolution of the images and points: quarter has metres (32FC1), half and full "
                 "micrometres (16UC1); more than 200 kB an image need larger socket buffers "
                 "(net.core.rmem_max). Default: quarter")
      ->transform(resolutions)
      ->type_name("full|half|quarter");
  app.add_flag("--all-points", arguments->settings.all_points,
               "Points of the whole surface, not of the contact alone");
  app.add_option("--hz", arguments->settings.hz, "Frames a second, at most; 0: all")
      ->check(cli::in_range(0, 1000))
      ->capture_default_str();
  CLI::Option* const record =
      app.add_option("--record", arguments->record,
                     "Write all topics of all sensors to an MCAP file, as ros2 bag record does")
          ->type_name("FILE")
          ->excludes(find);
  app.add_flag("--force", arguments->force, "Replace the file if it exists")->needs(record);
  app.add_option("--seconds", arguments->seconds, "End after so long")
      ->check(cli::positive())
      ->needs(record);
  app.add_flag("--humble", arguments->graph.humble,
               "Announce nodes as ROS 2 Humble does; else as Iron, Jazzy and later ones");
  app.callback([&context, arguments] {
    // write() then reports a limit on the file's size, like a full disk, and a reader of the output
    // that is gone, which does not matter to the graph.
    (void)std::signal(SIGXFSZ, SIG_IGN);
    (void)std::signal(SIGPIPE, SIG_IGN);
    const cli::Interruptible interruptible;
    while (Program(context, *arguments).run()) {
    }
  });
}

int run(const std::vector<std::string>& arguments, std::ostream& out, std::ostream& error) {
  CLI::App app;
  cli::Context context{{}, false, out};
  set_up(app, context);
  return cli::run(app, arguments, out, error);
}

}  // namespace dtact::dds
