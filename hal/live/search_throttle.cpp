#include "hal/live/search_throttle.hpp"

#include <sys/stat.h>

#include <filesystem>
#include <system_error>
#include <utility>

#include "hal/live/source.hpp"

namespace dtact::hal::live {
namespace {

/// Whether a node of a camera has been made or changed within SearchThrottle::kPeriod. A clock that
/// is set in the meantime costs one period at most.
bool has_new_nodes(const std::string& devices, std::chrono::system_clock::time_point date) {
  const std::time_t now = std::chrono::system_clock::to_time_t(date);
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(devices, error)) {
    const std::string name = entry.path().filename();
    if (!name.starts_with("media") && !name.starts_with("video")) continue;
    struct stat of{};
    if (::stat(entry.path().c_str(), &of) != 0) continue;
    const std::chrono::seconds age{now - of.st_ctim.tv_sec};
    if (age >= std::chrono::seconds(0) && age <= SearchThrottle::kPeriod) return true;
  }
  return false;
}

}  // namespace

bool SearchThrottle::due(std::chrono::steady_clock::time_point now,
                         std::chrono::system_clock::time_point date) {
  if (last_ && now - *last_ < kPeriod && !has_new_nodes(devices_, date)) return false;
  last_ = now;
  return true;
}

Opener paced(Opener open, SearchThrottle pace) {
  return [open = std::move(open), pace = std::move(pace),
          failed = std::optional<DeviceError>()]() mutable -> Opened {
    const bool due = pace.due(std::chrono::steady_clock::now(), std::chrono::system_clock::now());
    if (failed && !due) throw DeviceError(*failed);
    try {
      Opened opened = open();
      failed.reset();
      return opened;
    } catch (const DeviceError& e) {
      failed = e;
      throw;
    }
  };
}

}  // namespace dtact::hal::live
