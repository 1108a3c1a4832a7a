#include "daemon/app/files.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "daemon/app/config.hpp"
#include "daemon/app/service.hpp"
#include "daemon/net/calibration_store.hpp"
#include "daemon/pipeline/pipeline.hpp"
#include "daemon/serve/admission.hpp"
#include "daemon/serve/security.hpp"
#include "daemon/serve/tls.hpp"
#include "hal/base/atomic_file.hpp"
#include "hal/registry.hpp"

namespace dtact::app {
namespace {

/// A power cut leaves the temporary file of a write. Nobody else writes while the folder is locked.
void remove_cut_writes(const std::filesystem::path& folder) {
  constexpr std::size_t kRandom = 6;  // characters that base::write_file_atomically() adds
  std::vector<std::filesystem::path> left;
  std::error_code ignored;
  for (std::filesystem::directory_iterator entry(folder, ignored), end; !ignored && entry != end;
       entry.increment(ignored)) {
    const std::string name = entry->path().filename();
    for (const std::string_view file :
         {"reference.png.", "reference.toml.", "calibration.starts.", ".owner."}) {
      if (name.starts_with(file) && name.size() == file.size() + kRandom) left.push_back(*entry);
    }
  }
  for (const auto& file : left) std::filesystem::remove(file, ignored);
}

}  // namespace

void check_readable(const std::string& key, const std::filesystem::path& path) {
  std::error_code ignored;
  const int rights = std::filesystem::is_directory(path, ignored) ? R_OK | X_OK : R_OK;
  if (path.empty() || ::access(path.c_str(), rights) == 0) return;
  const int error = errno;
  throw std::runtime_error(fmt::format(
      "{} = \"{}\": {}{}", key, path.string(), std::strerror(error),
      under_systemd() ? "; the service sees nothing in /home, /root and /tmp: put it into "
                        "/etc/dtactd, readable to the user dtactd"
                      : ""));
}

void check_camera_files(const hal::CameraConfig& camera) {
  if (camera.backend == "sim") check_readable("camera.sim.scene", camera.sim.scene);
  if (camera.backend == "replay") check_readable("camera.replay.folder", camera.replay.folder);
}

void check_devices(const hal::Config& config) {
  check_camera_files(config.camera);
  hal::check_devices(config);
  const hal::CameraConfig& camera = config.camera;
  if (camera.backend == "replay") return;  // a recording has a size of its own
  hal::CameraInfo frames;
  frames.identity = camera.backend;
  frames.width = camera.width / camera.decode_scale;
  frames.height = camera.height / camera.decode_scale;
  frames.decode_scale = camera.decode_scale;
  frames.fps = camera.fps;
  pipeline::check_camera(frames);
}

std::filesystem::path calibration_folder(const Config& config) {
  if (!config.calibration.empty() || config.hal.camera.backend != "sim") return config.calibration;
  // A program that is not installed has none.
  std::error_code ignored;
  const bool missing = config.sim_calibration == kShippedCalibration &&
                       !std::filesystem::exists(kShippedCalibration, ignored);
  return missing ? std::filesystem::path() : config.sim_calibration;
}

void check_calibration(const Config& config) {
  const char* const key = config.calibration.empty() ? "camera.sim.calibration" : "calibration";
  check_readable(key, calibration_folder(config));
}

std::filesystem::path state_folder(const Config& config) {
  if (!config.state_dir.empty()) return config.state_dir;
  const std::string of_the_unit = state_directory();
  return of_the_unit.empty() ? "/var/lib/dtactd" : of_the_unit;
}

bool has_uploaded_calibration(const Config& config) {
  const net::FolderCalibrationStore store(state_folder(config), calibration_folder(config));
  return store.current() != calibration_folder(config);
}

base::UniqueFd own_state_folder(const std::filesystem::path& folder, const std::string& name) {
  // The lock is on the folder, so that it needs no room; the file is for people only.
  const std::filesystem::path file = folder / ".owner";
  base::UniqueFd fd(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (fd && ::flock(fd.get(), LOCK_EX | LOCK_NB) == 0) {
    remove_cut_writes(folder);
    try {
      base::write_file_atomically(
          file, fmt::format("dtactd, process {}, sensor \"{}\"\n", ::getpid(), name));
    } catch (const std::system_error&) {
      std::error_code ignored;
      std::filesystem::remove(file, ignored);  // it names another one
    }
    return fd;
  }
  const int error = errno;
  if (!fd || error != EWOULDBLOCK) {
    throw std::runtime_error(
        fmt::format("cannot lock the state folder {} ({}): set state_dir to a folder of this "
                    "machine that this user may read",
                    folder.string(), std::strerror(error)));
  }
  std::error_code ignored;
  std::string owner = std::filesystem::exists(file, ignored) ? base::read_file(file, 4096) : "";
  owner = owner.substr(0, owner.find('\n'));
  throw std::runtime_error(fmt::format(
      "the state folder {} belongs to {}: end it, or set state_dir to a folder of this sensor's "
      "own",
      folder.string(), owner.empty() ? "another dtactd that runs" : owner));
}

void resolve_credentials(net::NetConfig& config) {
  config.tls_certificate = resolve_credential("net.tls_certificate", config.tls_certificate);
  config.tls_key = resolve_credential("net.tls_key", config.tls_key);
  config.token_file = resolve_credential("net.tokens", config.token_file);
}

void check_net_files(net::NetConfig config) {
  net::check_security(config);
  const auto out_of_reach = [known = has_credentials()](const std::filesystem::path& file) {
    return !known && file.string().starts_with(kCredential);
  };
  if (out_of_reach(config.tls_certificate) || out_of_reach(config.tls_key)) {
    config.tls_certificate.clear();
    config.tls_key.clear();
  }
  if (out_of_reach(config.token_file)) config.token_file.clear();
  resolve_credentials(config);
  (void)net::make_tls(config);
  (void)net::read_tokens(config);
}

}  // namespace dtact::app
