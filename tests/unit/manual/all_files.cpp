#include <iostream>

#include "clients/calibrate/calibrate.hpp"
#include "clients/ctl/ctl.hpp"
#include "clients/dds/dds.hpp"
#include "clients/perceive/perceive.hpp"
#include "clients/web/web.hpp"
#include "daemon/app/options.hpp"
#include "hal/base/atomic_file.hpp"
#include "tests/unit/manual/pages.hpp"

namespace dtact::manual {
namespace {

constexpr const char* kUserCommands = "User Commands";

const PageName kDtactd{"dtactd", 8};
const PageName kConfig{"dtactd.toml", 5};
const PageName kCtl{"dtactctl", 1};
const PageName kCalibrate{"dtact-calibrate", 1};
const PageName kPerceive{"dtact-perceive", 1};
const PageName kWeb{"dtact-web", 1};
const PageName kDds{"dtact-dds", 1};

}  // namespace

Command dtactd() {
  app::Options options;
  CLI::App app;
  app::set_up(app, options);
  return describe(app);
}

Command dtactctl() {
  cli::Context context{{}, false, std::cout};
  CLI::App app;
  ctl::set_up(app, context);
  return describe(app);
}

Command dtact_calibrate() {
  cli::Context context{{}, false, std::cout};
  CLI::App app;
  calibrate::set_up(app, context);
  return describe(app);
}

Command dtact_perceive() {
  cli::Context context{{}, false, std::cout};
  CLI::App app;
  perceive::set_up(app, context);
  return describe(app);
}

Command dtact_dds() {
  cli::Context context{{}, false, std::cout};
  CLI::App app;
  dds::set_up(app, context);
  return describe(app);
}

Command dtact_web() {
  cli::Context context{{}, false, std::cout};
  CLI::App app;
  web::set_up(app, context);
  return describe(app);
}

std::vector<File> all_files(const std::filesystem::path& root) {
  const Command daemon = dtactd();
  const Command ctl = dtactctl();
  const Command calibrate = dtact_calibrate();
  const Command perceive = dtact_perceive();
  const Command web = dtact_web();
  const Command dds = dtact_dds();
  const PageNotes of_daemon{
      8,
      "System Administration",
      {{"/etc/dtactd/dtactd.toml", "The configuration that the unit dtactd.service names."},
       {"/etc/dtactd/NAME.toml",
        "Of the unit dtactd@NAME.service, for a further sensor; its state and socket lie in "
        "/var/lib/dtactd/NAME and /run/dtactd/NAME. NAME may not be dtactd, calibration or "
        "calibrations, which are the first one's own there."},
       {"/var/lib/dtactd",
        "Uploaded calibrations and the last good reference, unless `state_dir` or the unit names "
        "another folder. A daemon whose folder another one has ends and names that one. After "
        "three "
        "starts in a row that ended while they read the current uploaded calibration, the daemon "
        "begins with the configured one or none and says so in log and status; `dtactctl "
        "calibration "
        "activate` tries it again."},
       {"/run/dtactd/dtactd.sock",
        "For programs on this machine, unless `net.unix_socket` names another path."},
       {"/etc/credstore/dtactd.tokens, dtactd.tls-key, dtactd.tls-certificate",
        "Secrets that only root can read, which systemd hands in at a start; of "
        "dtactd@NAME.service "
        "dtactd@NAME.tokens and so on. They stay when the package is purged."},
       {"/etc/systemd/system/dtactd.service.d",
        "What `systemctl edit dtactd` has written. It stays when the package is purged."}},
      {kConfig, kCtl, kCalibrate, kPerceive, kWeb, kDds, {"systemctl", 1}, {"journalctl", 1}}};
  const PageNotes of_ctl{1, kUserCommands, {}, {kCalibrate, kDtactd, kConfig}};
  const PageNotes of_calibrate{1, kUserCommands, {}, {kCtl, kDtactd, kConfig}};
  const PageNotes of_perceive{1, kUserCommands, {}, {kDtactd, kCtl, kWeb}};
  const PageNotes of_dds{1, kUserCommands, {}, {kDtactd, kCtl, kPerceive}};
  const PageNotes of_web{1, kUserCommands, {}, {kDtactd, kCtl, kPerceive}};

  return {
      {"daemon/dtactd.8", program_page(daemon, of_daemon)},
      {"clients/ctl/dtactctl.1", program_page(ctl, of_ctl)},
      {"clients/calibrate/dtact-calibrate.1", program_page(calibrate, of_calibrate)},
      {"clients/perceive/dtact-perceive.1", program_page(perceive, of_perceive)},
      {"clients/web/dtact-web.1", program_page(web, of_web)},
      {"clients/dds/dtact-dds.1", program_page(dds, of_dds)},
      {"config/dtactd.toml.5", config_page(base::read_file(root / "config/dtactd.toml"))},
      {"daemon/dtactd.zsh-completion", zsh_completion(daemon)},
      {"clients/ctl/dtactctl.zsh-completion", zsh_completion(ctl)},
      {"clients/calibrate/dtact-calibrate.zsh-completion", zsh_completion(calibrate)},
      {"clients/perceive/dtact-perceive.zsh-completion", zsh_completion(perceive)},
      {"clients/web/dtact-web.zsh-completion", zsh_completion(web)},
      {"clients/dds/dtact-dds.zsh-completion", zsh_completion(dds)},
  };
}

}  // namespace dtact::manual
