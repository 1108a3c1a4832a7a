#pragma once

#include <array>
#include <csignal>
#include <cstddef>

namespace dtact::cli {

/// While an object of this class lives, Ctrl-C, SIGTERM and a closed terminal (SIGHUP) do not end
/// the program; happened() reports whether one came. A signal that the program was started to
/// ignore, as nohup(1) does with SIGHUP, stays ignored. One object at a time.
class Interruptible {
 public:
  Interruptible() {
    interrupted_ = 0;
    for (std::size_t i = 0; i < kSignals.size(); ++i) {
      before_[i] = std::signal(kSignals[i], [](int) { interrupted_ = 1; });
      if (before_[i] == SIG_IGN) (void)std::signal(kSignals[i], SIG_IGN);
    }
  }
  ~Interruptible() {
    for (std::size_t i = 0; i < kSignals.size(); ++i) (void)std::signal(kSignals[i], before_[i]);
  }
  Interruptible(const Interruptible&) = delete;
  Interruptible& operator=(const Interruptible&) = delete;

  [[nodiscard]] static bool happened() noexcept { return interrupted_ != 0; }

 private:
  static constexpr std::array kSignals{SIGINT, SIGTERM, SIGHUP};
  static inline volatile std::sig_atomic_t interrupted_ = 0;
  std::array<void (*)(int), kSignals.size()> before_{};
};

}  // namespace dtact::cli
