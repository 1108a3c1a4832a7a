#pragma once

#include <atomic>
#include <functional>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>

#include "hal/light_ring.hpp"

namespace dtact::fakes {

/// Records the lights that it shows; fails and is away on demand.
class FakeRing final : public hal::LightRing {
 public:
  /// The test's access while the pipeline owns the ring.
  struct Handle {
    std::atomic<bool> broken{false};
    std::atomic<bool> away{false};
    std::atomic<bool> released{false};  ///< The ring has been destroyed.
    std::function<void(const hal::Light&)> on_show;
    mutable std::mutex mutex;
    std::vector<hal::Light> shown;
    std::optional<hal::Light> attended;  // guarded by mutex: the light to re-send
    hal::RingReport report;              // guarded by mutex

    void set_report(hal::RingReport what) {
      const std::scoped_lock lock(mutex);
      report = std::move(what);
    }
    [[nodiscard]] std::vector<hal::Light> all() const {
      const std::scoped_lock lock(mutex);
      return shown;
    }
  };
  explicit FakeRing(Handle& handle) : handle_(handle) {}
  FakeRing(const FakeRing&) = delete;
  FakeRing& operator=(const FakeRing&) = delete;
  ~FakeRing() override { handle_.released = true; }

  [[nodiscard]] hal::RingInfo info() const override { return {"fake", "fake ring"}; }
  [[nodiscard]] hal::ShowResult show(const hal::Light& light) override {
    if (handle_.away) return {false, kAway, true};
    if (handle_.broken) return {false, "the fake ring is broken: fix it"};
    {
      const std::scoped_lock lock(handle_.mutex);
      handle_.shown.push_back(light);
    }
    if (handle_.on_show) handle_.on_show(light);
    return {};
  }
  [[nodiscard]] hal::RingReport attend(const hal::Light& light) override {
    const std::scoped_lock lock(handle_.mutex);
    handle_.attended = light;
    if (handle_.away) return {.ok = false, .away = true, .message = kAway, .note = {}};
    return handle_.report;
  }

 private:
  static constexpr const char* kAway = "the fake ring is away: plug it in";

  Handle& handle_;
};

}  // namespace dtact::fakes
