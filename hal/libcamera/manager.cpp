#include "hal/libcamera/manager.hpp"

#include <fmt/format.h>

#include <cstring>
#include <memory>
#include <mutex>

#include "hal/live/source.hpp"

namespace dtact::hal::libcamera_backend {
namespace {

struct Shared {
  std::mutex mutex;
  int users = 0;
  std::unique_ptr<libcamera::CameraManager> manager;
};

Shared& shared() {
  static Shared all;
  return all;
}

}  // namespace

Manager::Manager() {
  Shared& all = shared();
  const std::lock_guard guard(all.mutex);
  if (!all.manager) {
    auto manager = std::make_unique<libcamera::CameraManager>();
    if (const int e = manager->start(); e != 0) {
      throw live::DeviceError(CameraState::unplugged,
                              fmt::format("libcamera does not start ({})", std::strerror(-e)));
    }
    all.manager = std::move(manager);
  }
  ++all.users;
}

Manager::~Manager() {
  Shared& all = shared();
  // To the end of it: libcamera ends the program that begins a second one meanwhile.
  const std::lock_guard guard(all.mutex);
  if (--all.users == 0) all.manager.reset();
}

libcamera::CameraManager& Manager::operator*() const noexcept { return *shared().manager; }

}  // namespace dtact::hal::libcamera_backend
