#pragma once

#include <csignal>

namespace dtact::cli {

/// While an object of this class lives, Ctrl-C and SIGTERM do not end the program; happened()
/// reports whether one came. One object at a time.
class Interruptible {
 public:
  Interruptible() {
    interrupted_ = 0;
    interrupt_ = std::signal(SIGINT, [](int) { interrupted_ = 1; });
    terminate_ = std::signal(SIGTERM, [](int) { interrupted_ = 1; });
  }
  ~Interruptible() {
    (void)std::signal(SIGINT, interrupt_);
    (void)std::signal(SIGTERM, terminate_);
  }
  Interruptible(const Interruptible&) = delete;
  Interruptible& operator=(const Interruptible&) = delete;

  [[nodiscard]] static bool happened() noexcept { return interrupted_ != 0; }

 private:
  static inline volatile std::sig_atomic_t interrupted_ = 0;
  void (*interrupt_)(int);
  void (*terminate_)(int);
};

}  // namespace dtact::cli
