#include "tests/kernel/camera/uvcfake/controls.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstring>
#include <stdexcept>

#include "tests/kernel/camera/uvcfake/descriptors.hpp"

namespace uvcfake {
namespace {

enum Request { kSetCur = 1, kGetCur = 0x81, kMin, kMax, kRes, kLen, kInfo, kDef };

struct Control {
  const char* name;
  int entity;
  int selector;
  int bytes;
  int min;
  int max;
  int step;  // of exposure_mode: the bit set of its modes
  int initial;
  bool moves_by_itself;
  int current = initial;
  Fault fault = Fault::none;
  int reported = initial;  // the answer of a lying control
};

std::array<Control, 15> table{{
    {"exposure_mode", kCameraTerminal, 2, 1, 1, 8, 9, 8, false},
    {"exposure_priority", kCameraTerminal, 3, 1, 0, 1, 1, 1, false},
    {"exposure_time", kCameraTerminal, 4, 4, 1, 10000, 1, 156, true},
    {"focus", kCameraTerminal, 6, 2, 0, 255, 5, 50, false},
    {"focus_auto", kCameraTerminal, 8, 1, 0, 1, 1, 1, false},
    {"backlight", kProcessingUnit, 1, 2, 0, 2, 1, 1, false},
    {"brightness", kProcessingUnit, 2, 2, -64, 64, 1, 0, false},
    {"contrast", kProcessingUnit, 3, 2, 0, 64, 1, 32, false},
    {"gain", kProcessingUnit, 4, 2, 0, 100, 1, 0, true},
    {"power_line", kProcessingUnit, 5, 1, 0, 2, 1, 2, false},
    {"saturation", kProcessingUnit, 7, 2, 0, 128, 1, 64, false},
    {"sharpness", kProcessingUnit, 8, 2, 0, 6, 1, 3, false},
    {"gamma", kProcessingUnit, 9, 2, 72, 500, 1, 100, false},
    {"white_balance", kProcessingUnit, 10, 2, 2800, 6500, 1, 4600, true},
    {"white_balance_auto", kProcessingUnit, 11, 1, 0, 1, 1, 1, false},
}};

int value_of(const Control& c, int request) {
  switch (request) {
    case kMin:
      return c.min;
    case kMax:
      return c.max;
    case kRes:
      return c.step;
    case kLen:
      return c.bytes;
    case kInfo:
      return c.moves_by_itself ? 0x0b : 0x03;  // get, set, auto-update
    case kDef:
      return c.initial;
    default:
      return c.fault == Fault::lies ? c.reported : c.current;
  }
}

int answer_bytes(const Control& c, int request) {
  if (request == kLen) return 2;
  return request == kInfo ? 1 : c.bytes;
}

}  // namespace

void Controls::set_fault(const std::string& name, Fault fault) {
  std::string names;
  for (Control& c : table) {
    if (name == c.name) {
      c.fault = fault;
      return;
    }
    names += std::string(" ") + c.name;
  }
  throw std::runtime_error("no control " + name + "; there are" + names);
}

std::optional<int> Controls::handle(int entity, int selector, int request,
                                    std::span<std::uint8_t> data) {
  const auto c = std::ranges::find_if(
      table, [&](const Control& e) { return e.entity == entity && e.selector == selector; });
  if (c == table.end()) return std::nullopt;
  if (request != kSetCur) {
    const std::int32_t value = value_of(*c, request);
    const int n = answer_bytes(*c, request);
    std::memcpy(data.data(), &value, static_cast<std::size_t>(n));
    return n;
  }
  std::int32_t value = 0;
  std::memcpy(&value, data.data(), static_cast<std::size_t>(c->bytes));
  if (c->bytes == 2) value = static_cast<std::int16_t>(value);
  std::fprintf(stderr, "uvcfake: %s = %d\n", c->name, value);
  if (c->fault == Fault::refuses) return std::nullopt;
  if (c->fault == Fault::none) c->current = value;
  c->reported = value;
  return c->bytes;
}

void Controls::drift() {
  for (Control& c : table) {
    if (std::strcmp(c.name, "gain") == 0) c.current += 7;
  }
}

}  // namespace uvcfake
