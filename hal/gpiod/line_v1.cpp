// libgpiod 1.6 (Debian 12).
#include <gpiod.h>

#include <cerrno>
#include <memory>
#include <utility>

#include "hal/gpiod/lines.hpp"

namespace dtact::hal::gpiod {
namespace {

struct CloseChip {
  void operator()(gpiod_chip* chip) const noexcept { ::gpiod_chip_close(chip); }
};
using ChipPtr = std::unique_ptr<gpiod_chip, CloseChip>;

/// Closing the chip releases its lines.
class LineV1 final : public OutputLine {
 public:
  LineV1(ChipPtr chip, gpiod_line* line) : chip_(std::move(chip)), line_(line) {}
  [[nodiscard]] int set(bool active) noexcept override {
    return ::gpiod_line_set_value(line_, active ? 1 : 0) == 0 ? 0 : errno;
  }

 private:
  ChipPtr chip_;
  gpiod_line* line_;
};

int flags_of(const GpioLineConfig& line) {
  const int active_low = line.active_low ? GPIOD_LINE_REQUEST_FLAG_ACTIVE_LOW : 0;
  if (line.bias == "pull-up") return active_low | GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_UP;
  if (line.bias == "pull-down") return active_low | GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_DOWN;
  if (line.bias == "disabled") return active_low | GPIOD_LINE_REQUEST_FLAG_BIAS_DISABLE;
  return active_low;
}

}  // namespace

ChipFacts read_chip(const std::string& path) {
  const ChipPtr chip(::gpiod_chip_open(path.c_str()));
  if (chip == nullptr) return {{}, errno};
  const unsigned lines = ::gpiod_chip_num_lines(chip.get());
  ChipFacts facts{{path, ::gpiod_chip_label(chip.get()), static_cast<int>(lines), {}, {}}, 0};
  for (unsigned offset = 0; offset < lines; ++offset) {
    gpiod_line* line = ::gpiod_chip_get_line(chip.get(), offset);
    const char* name = line == nullptr ? nullptr : ::gpiod_line_name(line);
    facts.chip.names.emplace_back(name == nullptr ? "" : name);
  }
  return facts;
}

std::unique_ptr<OutputLine> request_output(const std::string& path, int offset,
                                           const GpioLineConfig& line, bool active, int& error) {
  ChipPtr chip(::gpiod_chip_open(path.c_str()));
  gpiod_line* handle =
      chip == nullptr ? nullptr : ::gpiod_chip_get_line(chip.get(), static_cast<unsigned>(offset));
  if (handle == nullptr ||
      ::gpiod_line_request_output_flags(handle, kConsumer, flags_of(line), active ? 1 : 0) != 0) {
    error = errno;
    return nullptr;
  }
  return std::make_unique<LineV1>(std::move(chip), handle);
}

std::string line_holder(const std::string& path, int line) {
  const ChipPtr chip(::gpiod_chip_open(path.c_str()));
  gpiod_line* handle =
      chip == nullptr ? nullptr : ::gpiod_chip_get_line(chip.get(), static_cast<unsigned>(line));
  if (handle == nullptr || !::gpiod_line_is_used(handle)) return {};
  return holder_name(::gpiod_line_consumer(handle));
}

std::string library_version() { return ::gpiod_version_string(); }

}  // namespace dtact::hal::gpiod
