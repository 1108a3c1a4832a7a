#pragma once

#include <cstdint>
#include <optional>
#include <utility>

#include "daemon/pipeline/exchange.hpp"

namespace dtact::pipeline {

/// Reports changes to the network thread. What does not fit into the queue stays due until a later
/// frame and is reported with that frame's numbers, unless the change has been reversed by then.
/// Results of commands are always reported. Capture thread only.
class EventReporter {
 public:
  explicit EventReporter(Exchange& exchange) : exchange_(exchange) {}

  /// Reference and answer: one of each may be due at a time.
  void reference(const ReferenceTaken& taken) noexcept { reference_ = taken; }
  void answer(CommandDone&& answer) noexcept { answer_ = std::move(answer); }
  [[nodiscard]] bool answer_due() const noexcept { return answer_.has_value(); }

  /// A frame that was not measured changes nothing: the earlier contact counts as held.
  void contact(const DepthFrame& frame) noexcept;
  /// For the status, and as an event on a change. A press at the LUT's end would cause one with
  /// every frame, so the report keeps Health::beyond_calibration a second longer than it lasts.
  void state(State state, HealthSet health, const Stamp& now) noexcept;
  /// Tries what is due.
  void flush() noexcept;

 private:
  template <typename T>
  [[nodiscard]] bool push(T&& event) noexcept;

  Exchange& exchange_;
  bool in_contact_ = false;            // as last reported
  std::optional<StateChanged> state_;  // as last reported
  std::int64_t beyond_until_ns_ = INT64_MIN;
  std::optional<ReferenceTaken> reference_;
  std::optional<CommandDone> answer_;
};

}  // namespace dtact::pipeline
