#include "daemon/app/doctor/machine.hpp"

#include <fcntl.h>
#include <grp.h>
#include <linux/videodev2.h>
#include <pwd.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <fstream>
#include <memory>
#include <span>
#include <sstream>
#include <stdexcept>
#include <string_view>

#include "hal/base/clock.hpp"
#include "hal/base/unique_fd.hpp"
#include "hal/ws2812/spi_wire.hpp"

namespace dtact::app {

namespace fs = std::filesystem;

int access_as(const std::string& user, const fs::path& file) {
  struct stat status{};
  if (::stat(file.c_str(), &status) != 0) return errno;
  const struct passwd* entry = ::getpwnam(user.c_str());
  if (entry == nullptr) return ENOENT;
  std::array<gid_t, 256> groups{};
  int count = groups.size();
  if (::getgrouplist(user.c_str(), entry->pw_gid, groups.data(), &count) < 0) return EOVERFLOW;
  const std::span<const gid_t> joined(groups.data(), static_cast<std::size_t>(count));
  const mode_t needed = status.st_uid == entry->pw_uid ? S_IRUSR | S_IWUSR
                        : std::ranges::find(joined, status.st_gid) != joined.end()
                            ? S_IRGRP | S_IWGRP
                            : S_IROTH | S_IWOTH;
  return (status.st_mode & needed) == needed ? 0 : EACCES;
}

fs::path Machine::below_root(const std::string& path) const {
  return root_ / fs::path(path).relative_path();
}

std::string Machine::text(const std::string& path) const {
  const std::ifstream file(below_root(path), std::ios::binary);
  std::ostringstream content;
  content << file.rdbuf();
  return content.str();
}

std::optional<std::string> Machine::line(const std::string& path) const {
  std::ifstream file(below_root(path));
  std::string first;
  if (!std::getline(file, first)) return std::nullopt;
  while (!first.empty() && first.back() == '\0') first.pop_back();  // device-tree strings
  return first;
}

std::vector<std::string> Machine::list(const std::string& folder, const std::string& prefix) const {
  std::vector<std::string> paths;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(below_root(folder), ignored)) {
    const std::string name = entry.path().filename();
    if (name.starts_with(prefix)) paths.push_back(fs::path(folder) / name);
  }
  std::sort(paths.begin(), paths.end());
  return paths;
}

bool Machine::has(const std::string& path) const {
  std::error_code ignored;
  return fs::exists(below_root(path), ignored);
}

bool Machine::has_service() const {
  return has("/etc/systemd/system/dtactd.service") || has("/usr/lib/systemd/system/dtactd.service");
}

int Machine::access(const std::string& path) const {
  if (privileged() && user() == kServiceUser) return access_as(kServiceUser, below_root(path));
  // The effective user is asked for: that is who opens it.
  return ::faccessat(AT_FDCWD, below_root(path).c_str(), R_OK | W_OK, AT_EACCESS) == 0 ? 0 : errno;
}

std::string Machine::group(const std::string& path) const {
  struct stat status{};
  if (::stat(below_root(path).c_str(), &status) != 0) return {};
  const struct group* entry = ::getgrgid(status.st_gid);
  return entry == nullptr ? "" : entry->gr_name;
}

std::string Machine::user() const {
  if (privileged() && ::getpwnam(kServiceUser) != nullptr) return kServiceUser;
  const struct passwd* entry = ::getpwuid(::geteuid());
  return entry == nullptr ? "<user>" : entry->pw_name;
}

bool Machine::privileged() const { return ::geteuid() == 0; }

rlim_t Machine::limit(int resource) const {
  struct rlimit value{};
  return ::getrlimit(static_cast<__rlimit_resource>(resource), &value) == 0 ? value.rlim_cur : 0;
}

Machine::Video Machine::video(const std::string& path) const {
  const base::UniqueFd fd(::open(below_root(path).c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC));
  if (!fd) return {.captures = false, .card = {}, .error = errno, .usb = false};
  v4l2_capability capability{};
  if (::ioctl(fd.get(), VIDIOC_QUERYCAP, &capability) != 0) {
    return {.captures = false, .card = {}, .error = errno, .usb = false};
  }
  const std::uint32_t node = (capability.capabilities & V4L2_CAP_DEVICE_CAPS) != 0
                                 ? capability.device_caps
                                 : capability.capabilities;
  return {
      .captures = (node & (V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_VIDEO_CAPTURE_MPLANE)) != 0,
      .card = reinterpret_cast<const char*>(capability.card),
      .error = 0,
      .usb =
          std::string_view(reinterpret_cast<const char*>(capability.bus_info)).starts_with("usb-")};
}

Machine::SpiRate Machine::spi_rate(const std::string& device, std::uint32_t asked_hz) const {
  try {
    hal::ws2812::Spidev port(below_root(device), asked_hz);
    const auto rate = hal::ws2812::measure_rate(port, base::system_clock());
    if (rate.error != 0) {
      return {0, "a transfer failed: " + hal::ws2812::spi_fix(rate.error)};
    }
    return {rate.hz, {}};
  } catch (const std::runtime_error& e) {
    return {0, e.what()};
  }
}

std::vector<hal::gpiod::Chip> Machine::gpio_chips() const { return hal::gpiod::list_chips(); }

std::string Machine::gpio_holder(const std::string& chip, int line) const {
  return hal::gpiod::line_holder(chip, line);
}

std::string Machine::firmware(const std::string& question) const {
  const auto close = [](std::FILE* pipe) { ::pclose(pipe); };
  // Only the doctor's own constants get here.
  std::FILE* const opened = ::popen(("vcgencmd " + question + " 2>/dev/null").c_str(), "re");
  const std::unique_ptr<std::FILE, decltype(close)> pipe(opened, close);
  std::array<char, 256> answer{};
  if (!pipe || std::fgets(answer.data(), answer.size(), pipe.get()) == nullptr) return {};
  std::string line(answer.data());
  while (!line.empty() && line.back() == '\n') line.pop_back();
  return line;
}

std::vector<hal::v4l2::SurveyedCamera> Machine::cameras() const {
  return hal::v4l2::survey_cameras();
}

}  // namespace dtact::app
