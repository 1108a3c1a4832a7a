#include "daemon/pipeline/command_executor.hpp"

#include <algorithm>
#include <type_traits>
#include <utility>
#include <variant>

namespace dtact::pipeline {

void CommandExecutor::begin(std::shared_ptr<ActiveCalibration> active) noexcept {
  active_ = std::move(active);
  if (!active_) return;
  tracker_.use(&active_->image);
  use_maps();
}

void CommandExecutor::take(bool camera_away, const Stamp& now) noexcept {
  // One at a time, and only while there is room for its result.
  Command command;
  while (!rezero_ && !reporter_.answer_due() && exchange_.commands.pop(command)) {
    const std::optional<Outcome> outcome = std::visit(
        [&](auto& what) -> std::optional<Outcome> {
          using What = std::remove_reference_t<decltype(what)>;
          if constexpr (std::is_same_v<What, Rezero>) {
            return execute(what, camera_away);
          } else if constexpr (std::is_same_v<What, SetLight> || std::is_same_v<What, SetCamera>) {
            // Never here: Pipeline::submit() gives them to the light driver.
            return Outcome::device_error;
          } else {
            return execute(what);
          }
        },
        command.what);
    if (outcome) {
      reporter_.answer({.command = std::move(command), .outcome = *outcome, .at = now});
    } else {
      rezero_ = std::move(command);
      rezero_since_ns_ = now.monotonic_ns;
    }
    reporter_.flush();
  }
}

std::optional<Outcome> CommandExecutor::execute(const Rezero& command, bool camera_away) noexcept {
  if (!active_) return Outcome::uncalibrated;
  if (camera_away) return Outcome::camera_away;
  return tracker_.rezero(command.force);
}

std::optional<Outcome> CommandExecutor::execute(UseCalibration& command) noexcept {
  std::swap(active_, command.prepared);
  key_ = command.key;
  tracker_.use(&active_->image);
  use_maps();
  exchange_.camera_mismatch.store(active_->camera_mismatch, std::memory_order_relaxed);
  return Outcome::done;
}

std::optional<Outcome> CommandExecutor::execute(SetReconstruction& command) noexcept {
  if (!command.prepared) return Outcome::done;
  std::swap(active_->maps, *command.prepared);
  use_maps();
  return Outcome::done;
}

std::optional<Outcome> CommandExecutor::execute(const CopyReference& command) noexcept {
  if (!active_) return Outcome::uncalibrated;
  if (!tracker_.ready()) return Outcome::no_reference;
  std::ranges::copy(tracker_.reference(), command.copy->image_q8.begin());
  command.copy->light = tracker_.ring_light();
  command.copy->sequence = reference_sequence_;
  command.copy->calibration = key_;
  return Outcome::done;
}

void CommandExecutor::use_maps() noexcept {
  depth_.use(&active_->maps, ++generation_);
  if (!tracker_.ready()) return;
  depth_.set_reference(tracker_.reference());
  depth_.set_light(tracker_.light());
}

void CommandExecutor::answer(Outcome outcome) noexcept {
  if (rezero_) reporter_.answer({.command = std::move(*rezero_), .outcome = outcome});
  rezero_.reset();
}

void CommandExecutor::abort_rezero() noexcept {
  tracker_.cancel_rezero();
  answer(Outcome::camera_away);
}

void CommandExecutor::limit_rezero(std::int64_t limit_ns, std::int64_t now_ns) noexcept {
  if (!rezero_ || now_ns - rezero_since_ns_ < limit_ns) return;
  tracker_.cancel_rezero();
  answer(Outcome::refused_unsteady);
}

}  // namespace dtact::pipeline
