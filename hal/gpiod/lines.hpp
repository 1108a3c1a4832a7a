#pragma once

#include <memory>
#include <string>
#include <vector>

#include "hal/config.hpp"

namespace dtact::hal::gpiod {

/// By what name the kernel shows who holds a line that OutputLine drives.
inline constexpr const char* kConsumer = "dtactd";

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
  std::vector<std::string> names;  ///< names of the lines by offset; empty for unnamed lines
  std::vector<std::string> links;  ///< Symbolic links to it: "/dev/gpiochip4" on a Raspberry Pi 5.
};

/// One chip. `error` is an errno when it could not be read; the other fields are then empty.
struct ChipFacts {
  Chip chip;
  int error = 0;
};

/// The chips of this machine that may be opened, by path.
[[nodiscard]] std::vector<Chip> list_chips();

/// Where a configured line is. When it is nowhere, `why` says so and `fix` how to go on; both name
/// `key`, the configuration's, where they have to.
struct Place {
  std::string chip;  ///< Path.
  int line = -1;     ///< Offset.
  std::string why, fix;
  bool unknown = false;  ///< None of the chips has the chip's or the line's name.
};
[[nodiscard]] Place find_line(const std::vector<Chip>& chips, const GpioLineConfig& line,
                              const std::string& key);

/// The line as messages name it: chip "gpiochip0" line 17, or line "GPIO17".
[[nodiscard]] std::string describe(const GpioLineConfig& line);

/// Takes the line as output with the given first level. The chip may be named by path
/// ("/dev/gpiochip0"), name ("gpiochip0") or label. `key` is the configuration's key, for the
/// error's sentence. Throws std::runtime_error naming key, line and the fix.
[[nodiscard]] std::unique_ptr<OutputLine> open_output(const GpioLineConfig& line, bool active,
                                                      const std::string& key);

// What differs between libgpiod 1.6 and 2: line_v1.cpp or line_v2.cpp, chosen when built.

[[nodiscard]] ChipFacts read_chip(const std::string& path);
/// Takes the line at `offset`; of `line` only active_low and bias count. Null with errno in `error`
/// when refused.
[[nodiscard]] std::unique_ptr<OutputLine> request_output(const std::string& path, int offset,
                                                         const GpioLineConfig& line, bool active,
                                                         int& error);
/// A consumer as messages name it. Parts of the kernel hold lines without a name, or as "?".
[[nodiscard]] std::string holder_name(const char* consumer);
/// The name of the line's consumer, in quotes; empty when the line is free.
[[nodiscard]] std::string line_holder(const std::string& path, int line);
[[nodiscard]] std::string library_version();

}  // namespace dtact::hal::gpiod
