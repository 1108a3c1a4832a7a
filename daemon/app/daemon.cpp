#include "daemon/app/daemon.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <array>
#include <boost/asio/io_context.hpp>
#include <boost/asio/signal_set.hpp>
#include <chrono>
#include <csignal>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <random>
#include <stdexcept>
#include <string_view>
#include <system_error>
#include <utility>

#include "daemon/announce/announcer.hpp"
#include "daemon/app/files.hpp"
#include "daemon/app/journal.hpp"
#include "daemon/app/reload.hpp"
#include "daemon/app/service.hpp"
#include "daemon/app/status_reporter.hpp"
#include "daemon/app/throttle_timer.hpp"
#include "daemon/app/watchdog.hpp"
#include "daemon/calibration/calibration.hpp"
#include "daemon/metrics/endpoint.hpp"
#include "daemon/metrics/text.hpp"
#include "daemon/net/calibration_store.hpp"
#include "daemon/net/light_schemes.hpp"
#include "daemon/net/server.hpp"
#include "daemon/pipeline/pipeline.hpp"
#include "daemon/serve/security.hpp"
#include "hal/base/clock.hpp"
#include "hal/base/cpu_claim.hpp"
#include "hal/base/free_memory.hpp"
#include "hal/base/machine.hpp"
#include "hal/base/rt_thread.hpp"
#include "hal/base/unique_fd.hpp"
#include "hal/registry.hpp"
#include "version.hpp"

namespace dtact::app {
namespace {

namespace fs = std::filesystem;
namespace asio = boost::asio;

fs::path make_state_folder(const Config& config) {
  fs::path folder = state_folder(config);
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) {
    throw std::runtime_error(fmt::format(
        "cannot make the state folder {} ({}): set state_dir to a folder this user may write",
        folder.string(), error.message()));
  }
  return folder;
}

/// Says that the current calibration is not used, which it names, and what to do.
std::string passed_over(const net::FolderCalibrationStore& store, bool configured) {
  const fs::path folder = store.current();
  const auto current = store.current_number();
  const std::string number = current ? std::to_string(*current) : folder.string();
  return fmt::format(
      "Calibration {0} ({1}) is not used: {2} starts with it ended early. The daemon runs with "
      "{3}. "
      "`dtactctl calibration download {0}` saves it, `dtactctl calibration activate` takes another "
      "one or tries it again.",
      number, folder.filename().string(), net::FolderCalibrationStore::kMaxFailedStarts,
      configured ? "the configured calibration" : "no calibration");
}

/// The calibration to start with; null when there is none, or none that can be read. `note` becomes
/// a sentence for the status when something is wrong with it.
std::shared_ptr<const calibration::Calibration> load_calibration(const fs::path& folder,
                                                                 const Config& config,
                                                                 std::string& note) {
  if (folder.empty()) {
    spdlog::warn(
        "no calibration: serving the camera's image only. Make one with `dtact-calibrate depth`"
        " and send it with `dtactctl calibration upload`");
    return nullptr;
  }
  const bool is_configured = folder == calibration_folder(config);
  try {
    if (is_configured) check_calibration(config);
    auto loaded = std::make_shared<const calibration::Calibration>(calibration::load(folder));
    spdlog::info("calibration {} from {}", loaded->name, folder.string());
    return loaded;
  } catch (const std::exception& e) {
    // What the configuration names is fixed there. An uploaded one can be replaced only by a
    // daemon that runs.
    if (is_configured) throw;
    note = fmt::format(
        "{}; serving the camera's image only: `dtactctl calibration list` shows the others and "
        "`dtactctl calibration activate` takes one of them",
        e.what());
    spdlog::warn("{}", note);
    return nullptr;
  }
}

/// The pipeline with all its tables: the end of what counts as a start with the calibration.
std::unique_ptr<pipeline::Pipeline> make_pipeline(
    hal::Devices devices, const std::shared_ptr<const calibration::Calibration>& calibration,
    const pipeline::PipelineConfig& settings, net::FolderCalibrationStore& store) {
  try {
    auto pipeline = std::make_unique<pipeline::Pipeline>(
        std::move(devices.camera), std::move(devices.ring), calibration, settings);
    store.end_start();
    return pipeline;
  } catch (const std::invalid_argument&) {
    store.end_start();  // it is the camera that does not do
    throw;
  }
}

net::NetConfig make_net_config(const Config& config) {
  net::NetConfig net = config.net;
  const fs::path run = runtime_directory();
  if (net.unix_socket.empty() && !run.empty()) net.unix_socket = run / "dtactd.sock";
  net.program = "dtactd " DTACT_VERSION;
  net.version = DTACT_VERSION;
  if (net.name.empty()) net.name = default_name();
  resolve_credentials(net);
  net.log = [](const net::LogLine& line) {
    constexpr std::array kLevels{spdlog::level::debug, spdlog::level::info, spdlog::level::warn};
    log_line(kLevels.at(static_cast<std::size_t>(line.level)), line.text,
             {{"DTACT_CLIENT", line.client}, {"DTACT_TOKEN", line.token}});
  };
  return net;
}

/// Nothing when none is configured.
std::optional<metrics::Endpoint> serve_metrics(asio::io_context& io,
                                               const metrics::EndpointConfig& config,
                                               const net::Server& server) {
  if (config.port == 0) return std::nullopt;
  spdlog::info("metrics on http://{}:{}/metrics", config.address, config.port);
  return std::optional<metrics::Endpoint>(std::in_place, io, config, [&server] {
    return metrics::text(server.overview(), base::heap(), base::system_clock().monotonic_ns());
  });
}

/// Nothing where only this machine can connect.
std::optional<announce::Announcer> announce_service(asio::io_context& io, const Config& config,
                                                    const std::string& instance,
                                                    const net::Server& server) {
  if (!config.announce || !announce::is_reachable(config.net.address)) return std::nullopt;
  const auto ask = [&address = config.net.address, instance, &server] {
    const v1::Status status = server.overview().status;
    const v1::Endpoint& tcp = *status.endpoints().rbegin();  // a socket file comes before it
    announce::Service service;
    service.name = status.name();
    service.port = server.port();
    service.txt = announce::txt_of({.version = DTACT_VERSION,
                                    .serial = status.serial(),
                                    .instance = instance,
                                    .tls = tcp.tls(),
                                    .token = tcp.token()});
    announce::restrict_to(address, service);
    return service;
  };
  return std::optional<announce::Announcer>(
      std::in_place, io, ask, [](const std::string& line) { spdlog::info("{}", line); });
}

/// Takes what can change from a configuration that was read again; from a broken one nothing.
/// Returns what `systemctl status` is to say of it.
std::string reload(Config& running, const std::function<Config()>& load, net::Server& server) {
  try {
    const Config wanted = load();
    Reload fresh = merge(running, wanted);
    // What is to be switched off stays until the restart, but its files may be gone already.
    Config files = fresh.config;
    if (wanted.net.tls_certificate.empty()) {
      files.net.tls_certificate.clear();
      files.net.tls_key.clear();
    }
    if (wanted.net.token_file.empty()) files.net.token_file.clear();
    server.reload(make_net_config(files));
    running = std::move(fresh.config);
    spdlog::set_level(spdlog::level::from_str(running.log_level));
    spdlog::info("{}", what_was_read(fresh));
    std::string waits = what_waits(fresh);
    if (!waits.empty()) spdlog::warn("{}", waits);
    return waits;
  } catch (const std::exception& e) {
    spdlog::error("the configuration stays as it was: {}", e.what());
    return fmt::format("the configuration stays as it was: {}", e.what());
  }
}

}  // namespace

void run_daemon(const Config& config, const std::function<Config()>& load) {
  const auto began = std::chrono::steady_clock::now();
  const auto log_step = [began](std::string_view step) {
    spdlog::debug("start: {} after {} ms", step,
                  std::chrono::duration_cast<std::chrono::milliseconds>(
                      std::chrono::steady_clock::now() - began)
                      .count());
  };
  base::keep_little_memory();
  base::demote_at_rttime_limit();
  asio::io_context io(1);
  // Before any thread starts, so that every thread leaves the signals to this one.
  asio::signal_set signals(io, SIGTERM, SIGINT);
  asio::signal_set hangups(io, SIGHUP);
  bool stopping = false;
  std::function<void()> end_service;  // once the daemon serves
  signals.async_wait([&](const boost::system::error_code& error, int signal) {
    if (error) return;
    spdlog::info("{}: stopping", signal == SIGTERM ? "SIGTERM" : "SIGINT");
    notify_stopping();
    stopping = true;
    if (end_service) end_service();
  });
  // Asked between the steps of the start, each of which may take seconds.
  const auto asked_to_stop = [&] {
    io.poll();
    return stopping;
  };

  net::NetConfig net = make_net_config(config);
  std::random_device random;
  const std::string instance = fmt::format("{:08x}{:08x}", random(), random());
  net.instance = instance;
  name_sensor(net.name);
  const fs::path state = make_state_folder(config);
  const base::UniqueFd owned = own_state_folder(state, net.name);
  net::FolderCalibrationStore store(state, calibration_folder(config));

  check_camera_files(config.hal.camera);
  hal::Devices devices = hal::open_devices(config.hal);
  log_step("camera and ring are open");
  if (asked_to_stop()) return;
  const hal::RingReport ring = devices.ring->attend(config.pipeline.light);
  if (ring.away) spdlog::warn("no LED ring yet, it is looked for: {}", ring.message);
  if (!ring.note.empty()) spdlog::warn("ring: {}", ring.note);
  pipeline::PipelineConfig settings = config.pipeline;
  std::optional<base::CpuClaim> cpu;
  if (config.cpu_is_default && settings.cpu) {
    settings.cpu = cpu.emplace(base::allowed_cpus()).cpu();
  }
  settings.state_folder = state;
  if (const auto leds = net::scheme_leds(config.ring_scheme)) settings.light.leds = *leds;
  if (config.hal.ring.backend.starts_with("ws2812")) {
    settings.light.gamma = config.hal.ring.ws2812.gamma;
  }
  // From here until the pipeline has its tables, an end of this process counts as the
  // calibration's.
  fs::path folder = store.current();
  if (!store.begin_start()) {
    folder = calibration_folder(config);
    settings.calibration_note = passed_over(store, !folder.empty());
    spdlog::warn("{}", settings.calibration_note);
  }
  auto calibration = load_calibration(folder, config, settings.calibration_note);
  log_step("the calibration is read");
  if (asked_to_stop()) {
    store.end_start();  // the calibration is not the cause
    return;
  }
  const bool uncalibrated = calibration == nullptr;
  const auto made = make_pipeline(std::move(devices), calibration, settings, store);
  log_step("its tables are made");
  if (asked_to_stop()) return;
  pipeline::Pipeline& pipeline = *made;
  calibration.reset();  // its megabytes go when another one comes into use
  if (net.fifo_priority > 0) {
    net.realtime_refused = base::make_fifo("network", net.fifo_priority).value_or("");
    if (!net.realtime_refused.empty()) spdlog::warn("{}", net.realtime_refused);
  }
  net::Server server(io, std::move(net), pipeline, store);
  auto announced = announce_service(io, config, instance, server);
  auto metrics = serve_metrics(io, config.metrics, server);
  pipeline.start();
  log_step("the camera is started");
  for (const std::string& refused : pipeline.status().realtime) spdlog::warn("{}", refused);

  pipeline::HealthSet reported;
  reported.set(pipeline::Health::uncalibrated, uncalibrated);
  reported.set(pipeline::Health::ring_fault, ring.away);
  reported.set(pipeline::Health::not_realtime, !pipeline.status().realtime.empty());
  StatusReporter reporter(
      io, [&pipeline] { return pipeline.status(); },
      fmt::format("listening on {}", fmt::join(server.addresses(), " and ")), reported);
  Config running = config;
  std::function<void()> wait_for_hangup = [&] {
    hangups.async_wait([&](const boost::system::error_code& error, int) {
      if (error || stopping) return;  // one that came with the signal to stop has no error
      notify_reloading();
      reporter.set_note(reload(running, load, server));
      notify_ready(reporter.text());
      wait_for_hangup();
    });
  };
  wait_for_hangup();
  Watchdog watchdog(io, [&pipeline] { return pipeline.heartbeat(); });
  ThrottleTimer throttle_timer(io);
  end_service = [&] {
    hangups.cancel();
    reporter.stop();
    watchdog.stop();
    throttle_timer.stop();
    if (announced) announced->stop();
    if (metrics) metrics->stop();
    server.stop();
  };

  // Once for each, so that a line ends with one address.
  for (const std::string& address : server.addresses()) {
    spdlog::info("dtactd {}, listening on {}", DTACT_VERSION, address);
  }
  if (under_systemd() && net::reaches_beyond(config.net)) {
    spdlog::info(
        "other machines get through where IPAddressAllow= of the unit names them: sudo systemctl "
        "edit dtactd, see network.conf in /usr/share/doc/dtactd/examples");
  }
  notify_ready(reporter.text());
  io.run();
  pipeline.stop();
}

}  // namespace dtact::app
