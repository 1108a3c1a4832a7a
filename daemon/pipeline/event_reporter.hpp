#pragma once

#include <cstdint>
#include <optional>
#include <utility>

#include "daemon/pipeline/exchange.hpp"

namespace dtact::pipeline {

/// Tells the network what changed. What does not fit into the queue stays due and is told with a
/// later frame, with that frame's numbers: a change that has been undone by then is not told.
/// Answers to commands are all told. Capture thread only.
class EventReporter {
 public:
  explicit EventReporter(Exchange& exchange) : exchange_(exchange) {}

  /// Reference and answer: one of each may be due at a time.
  void reference(const ReferenceTaken& taken) noexcept { reference_ = taken; }
  void answer(CommandDone&& answer) noexcept { answer_ = std::move(answer); }
  [[nodiscard]] bool answer_due() const noexcept { return answer_.has_value(); }

  /// A frame that was not measured changes nothing: what touched before it counts as held.
  void contact(const DepthFrame& frame) noexcept;
  /// For the status, and as an event where it changed. A press at the list's end would send one
  /// with every frame: Health::beyond_calibration is told to last a second longer than it does.
  void state(State state, HealthSet health, const Stamp& now) noexcept;
  /// Tries what is due.
  void flush() noexcept;

 private:
  template <typename T>
  [[nodiscard]] bool push(T&& event) noexcept;

  Exchange& exchange_;
  bool in_contact_ = false;            // as told
  std::optional<StateChanged> state_;  // as told
  std::int64_t beyond_until_ns_ = INT64_MIN;
  std::optional<ReferenceTaken> reference_;
  std::optional<CommandDone> answer_;
};

}  // namespace dtact::pipeline
