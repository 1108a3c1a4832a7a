// libgpiod 2 (Debian 13).
#include <gpiod.h>

#include <cerrno>
#include <memory>
#include <utility>

#include "hal/gpiod/lines.hpp"

namespace dtact::hal::gpiod {
namespace {

template <auto release>
struct Release {
  template <typename T>
  void operator()(T* handle) const noexcept {
    release(handle);
  }
};
using ChipPtr = std::unique_ptr<gpiod_chip, Release<::gpiod_chip_close>>;
using ChipInfoPtr = std::unique_ptr<gpiod_chip_info, Release<::gpiod_chip_info_free>>;
using LineInfoPtr = std::unique_ptr<gpiod_line_info, Release<::gpiod_line_info_free>>;
using SettingsPtr = std::unique_ptr<gpiod_line_settings, Release<::gpiod_line_settings_free>>;
using ConfigPtr = std::unique_ptr<gpiod_line_config, Release<::gpiod_line_config_free>>;
using NamePtr = std::unique_ptr<gpiod_request_config, Release<::gpiod_request_config_free>>;
using RequestPtr = std::unique_ptr<gpiod_line_request, Release<::gpiod_line_request_release>>;

gpiod_line_bias bias_of(const GpioLineConfig& line) {
  if (line.bias == "pull-up") return GPIOD_LINE_BIAS_PULL_UP;
  if (line.bias == "pull-down") return GPIOD_LINE_BIAS_PULL_DOWN;
  if (line.bias == "disabled") return GPIOD_LINE_BIAS_DISABLED;
  return GPIOD_LINE_BIAS_AS_IS;
}

gpiod_line_value value_of(bool active) {
  return active ? GPIOD_LINE_VALUE_ACTIVE : GPIOD_LINE_VALUE_INACTIVE;
}

/// A request outlives its chip's handle.
class LineV2 final : public OutputLine {
 public:
  LineV2(RequestPtr request, unsigned line) : request_(std::move(request)), line_(line) {}
  [[nodiscard]] int set(bool active) noexcept override {
    return ::gpiod_line_request_set_value(request_.get(), line_, value_of(active)) == 0 ? 0 : errno;
  }

 private:
  RequestPtr request_;
  unsigned line_;
};

}  // namespace

ChipFacts read_chip(const std::string& path) {
  const ChipPtr chip(::gpiod_chip_open(path.c_str()));
  if (chip == nullptr) return {{}, errno};
  const ChipInfoPtr info(::gpiod_chip_get_info(chip.get()));
  if (info == nullptr) return {{}, errno};
  const std::size_t lines = ::gpiod_chip_info_get_num_lines(info.get());
  ChipFacts facts{{path, ::gpiod_chip_info_get_label(info.get()), static_cast<int>(lines), {}, {}},
                  0};
  for (unsigned offset = 0; offset < lines; ++offset) {
    const LineInfoPtr line(::gpiod_chip_get_line_info(chip.get(), offset));
    const char* name = line == nullptr ? nullptr : ::gpiod_line_info_get_name(line.get());
    facts.chip.names.emplace_back(name == nullptr ? "" : name);
  }
  return facts;
}

std::unique_ptr<OutputLine> request_output(const std::string& path, int line_offset,
                                           const GpioLineConfig& line, bool active, int& error) {
  const auto offset = static_cast<unsigned>(line_offset);
  const ChipPtr chip(::gpiod_chip_open(path.c_str()));
  const SettingsPtr settings(::gpiod_line_settings_new());
  const ConfigPtr config(::gpiod_line_config_new());
  const NamePtr name(::gpiod_request_config_new());
  if (chip == nullptr || settings == nullptr || config == nullptr || name == nullptr) {
    error = errno;
    return nullptr;
  }
  ::gpiod_line_settings_set_active_low(settings.get(), line.active_low);
  ::gpiod_request_config_set_consumer(name.get(), kConsumer);
  RequestPtr request;
  if (::gpiod_line_settings_set_direction(settings.get(), GPIOD_LINE_DIRECTION_OUTPUT) == 0 &&
      ::gpiod_line_settings_set_bias(settings.get(), bias_of(line)) == 0 &&
      ::gpiod_line_settings_set_output_value(settings.get(), value_of(active)) == 0 &&
      ::gpiod_line_config_add_line_settings(config.get(), &offset, 1, settings.get()) == 0) {
    request.reset(::gpiod_chip_request_lines(chip.get(), name.get(), config.get()));
  }
  if (request == nullptr) {
    error = errno;
    return nullptr;
  }
  return std::make_unique<LineV2>(std::move(request), offset);
}

std::string line_holder(const std::string& path, int line) {
  const ChipPtr chip(::gpiod_chip_open(path.c_str()));
  if (chip == nullptr) return {};
  const LineInfoPtr info(::gpiod_chip_get_line_info(chip.get(), static_cast<unsigned>(line)));
  if (info == nullptr || !::gpiod_line_info_is_used(info.get())) return {};
  return holder_name(::gpiod_line_info_get_consumer(info.get()));
}

std::string library_version() { return ::gpiod_api_version(); }

}  // namespace dtact::hal::gpiod
