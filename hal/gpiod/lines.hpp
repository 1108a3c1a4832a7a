#pragma once

#include <memory>
#include <string>
#include <vector>

#include "hal/config.hpp"

namespace dtact::hal::gpiod {

/// A line this process drives. Given back on destruction; what level it has then is the GPIO
/// driver's choice (most keep it, some fall back to the boot-up state).
class OutputLine {
 public:
  OutputLine() = default;
  OutputLine(const OutputLine&) = delete;
  OutputLine& operator=(const OutputLine&) = delete;
  virtual ~OutputLine() = default;

  /// Drives the line. Returns 0 or an errno. Does not allocate.
  [[nodiscard]] virtual int set(bool active) noexcept = 0;
};

struct Chip {
  std::string path;   ///< "/dev/gpiochip0"
  std::string label;  ///< "pinctrl-bcm2711", ...
  int lines = 0;
};

/// One chip. `error` is an errno when it could not be read; the other fields are then empty.
struct ChipFacts {
  Chip chip;
  int error = 0;
};

/// The chips of this machine that may be opened, by path.
[[nodiscard]] std::vector<Chip> list_chips();

/// Takes the line as output with the given first level. The chip may be named by path
/// ("/dev/gpiochip0"), name ("gpiochip0") or label. `key` is the configuration's key, for the
/// error's sentence. Throws std::runtime_error naming key, chip, line and the remedy.
[[nodiscard]] std::unique_ptr<OutputLine> open_output(const GpioLineConfig& line, bool active,
                                                      const std::string& key);

// What differs between libgpiod 1.6 and 2: line_v1.cpp or line_v2.cpp, chosen when built.

[[nodiscard]] ChipFacts read_chip(const std::string& path);
/// Null with errno in `error` when refused.
[[nodiscard]] std::unique_ptr<OutputLine> request_output(const std::string& path,
                                                         const GpioLineConfig& line, bool active,
                                                         int& error);
/// Who holds the line; empty when nobody, or when the holder gave no name.
[[nodiscard]] std::string line_holder(const std::string& path, int line);
[[nodiscard]] std::string library_version();

}  // namespace dtact::hal::gpiod
