#include "daemon/pipeline/order_desk.hpp"

#include <algorithm>
#include <utility>
#include <variant>

namespace dtact::pipeline {

void OrderDesk::begin(std::shared_ptr<ActiveCalibration> active) noexcept {
  active_ = std::move(active);
  if (!active_) return;
  untouched_.use(&active_->image);
  use_maps();
}

void OrderDesk::take(bool camera_away, const Stamp& now) noexcept {
  // One at a time, and only while its answer has somewhere to go.
  Command command;
  while (!rezero_ && !teller_.answer_due() && exchange_.commands.pop(command)) {
    std::optional<Outcome> outcome;
    if (auto* rezero = std::get_if<Rezero>(&command.what)) outcome = execute(*rezero, camera_away);
    if (auto* use = std::get_if<UseCalibration>(&command.what)) outcome = execute(*use);
    if (auto* how = std::get_if<SetReconstruction>(&command.what)) outcome = execute(*how);
    if (auto* copy = std::get_if<CopyReference>(&command.what)) outcome = execute(*copy);
    if (outcome) {
      teller_.answer({.command = std::move(command), .outcome = *outcome, .at = now});
    } else {
      rezero_ = std::move(command);
    }
    teller_.flush();
  }
}

std::optional<Outcome> OrderDesk::execute(const Rezero& command, bool camera_away) noexcept {
  if (!active_) return Outcome::uncalibrated;
  if (camera_away) return Outcome::camera_away;
  return untouched_.rezero(command.force);
}

std::optional<Outcome> OrderDesk::execute(UseCalibration& command) noexcept {
  std::swap(active_, command.prepared);
  key_ = command.key;
  untouched_.use(&active_->image);
  use_maps();
  exchange_.camera_mismatch.store(active_->camera_mismatch, std::memory_order_relaxed);
  return Outcome::done;
}

std::optional<Outcome> OrderDesk::execute(SetReconstruction& command) noexcept {
  if (!command.prepared) return Outcome::done;
  std::swap(active_->maps, *command.prepared);
  use_maps();
  return Outcome::done;
}

std::optional<Outcome> OrderDesk::execute(const CopyReference& command) noexcept {
  if (!active_) return Outcome::uncalibrated;
  if (!untouched_.ready()) return Outcome::no_reference;
  std::ranges::copy(untouched_.reference(), command.copy->image_q8.begin());
  command.copy->light = untouched_.shown();
  command.copy->sequence = reference_sequence_;
  command.copy->calibration = key_;
  return Outcome::done;
}

void OrderDesk::use_maps() noexcept {
  depth_.use(&active_->maps, ++generation_);
  if (!untouched_.ready()) return;
  depth_.set_reference(untouched_.reference());
  depth_.set_light(untouched_.light());
}

void OrderDesk::answer(Outcome outcome) noexcept {
  if (rezero_) teller_.answer({.command = std::move(*rezero_), .outcome = outcome});
  rezero_.reset();
}

void OrderDesk::give_up_rezero() noexcept {
  untouched_.cancel_rezero();
  answer(Outcome::camera_away);
}

}  // namespace dtact::pipeline
