#pragma once

#include <filesystem>
#include <string>

#include "clients/calibrate/guided/console.hpp"
#include "clients/cpp/options.hpp"
#include "clients/perceive/recognition/touch_map.hpp"

namespace dtact::objects {

/// The grid of a depth message, for touch_map(). Throws client::ProtocolError where it contradicts
/// itself, or is too coarse.
[[nodiscard]] perceive::TouchMap touch_map_of(const v1::DepthMap& depth);

/// What keeps a press from being used, for the user to change: empty where nothing does.
[[nodiscard]] std::string fault_of(const perceive::TouchMap& press);

struct Lesson {
  std::filesystem::path folder;  ///< Of the taught objects.
  std::string name;
  int presses = 10;
};

/// Takes one map of each press, the first one at rest, from the running daemon and stores them all
/// at the end; earlier ones of this name are replaced. Waits for a daemon that goes away meanwhile.
/// Says then what each press would be taken for without itself. Throws as client::Client, and
/// std::runtime_error where the user ends it early.
void teach(const Lesson& lesson, const client::Options& target, ctl::guided::Console& console);

}  // namespace dtact::objects
