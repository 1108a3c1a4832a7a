#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "daemon/pipeline/active_calibration.hpp"
#include "daemon/pipeline/depth/depth_maker.hpp"
#include "daemon/pipeline/event_reporter.hpp"
#include "daemon/pipeline/exchange.hpp"
#include "daemon/pipeline/reference/reference_tracker.hpp"

namespace dtact::pipeline {

/// Executes the commands from the network thread one at a time and reports their outcomes. Owns the
/// calibration in use, which changes by command only. Capture thread only.
class CommandExecutor {
 public:
  CommandExecutor(Exchange& exchange, EventReporter& reporter, ReferenceTracker& tracker,
                  DepthMaker& depth)
      : exchange_(exchange), reporter_(reporter), tracker_(tracker), depth_(depth) {}

  /// The first calibration; null: uncalibrated.
  void begin(std::shared_ptr<ActiveCalibration> active) noexcept;
  void take(bool camera_away, const Stamp& now) noexcept;
  /// A new reference is in use; `sequence` is that of its last frame.
  void reference_taken(std::uint64_t sequence) noexcept { reference_sequence_ = sequence; }
  /// Reports the outcome of the re-zero in progress, if any.
  void answer(Outcome outcome) noexcept;
  /// No frames arrive: aborts the re-zero in progress, if any.
  void abort_rezero() noexcept;
  /// Refuses the re-zero in progress, if any, once it has taken `limit_ns`: light that goes on
  /// changing would put it off without end, and all commands after it.
  void limit_rezero(std::int64_t limit_ns, std::int64_t now_ns) noexcept;

  /// The calibration in use; null: uncalibrated.
  [[nodiscard]] const ActiveCalibration* active() const noexcept { return active_.get(); }
  /// UseCalibration::key of active().
  [[nodiscard]] std::uint64_t key() const noexcept { return key_; }

 private:
  // Each returns the outcome, or nothing while the command is in progress.
  std::optional<Outcome> execute(const Rezero& command, bool camera_away) noexcept;
  std::optional<Outcome> execute(UseCalibration& command) noexcept;
  std::optional<Outcome> execute(SetReconstruction& command) noexcept;
  std::optional<Outcome> execute(const CopyReference& command) noexcept;
  void use_maps() noexcept;

  Exchange& exchange_;
  EventReporter& reporter_;
  ReferenceTracker& tracker_;
  DepthMaker& depth_;
  std::shared_ptr<ActiveCalibration> active_;
  std::uint64_t key_ = 0;
  std::uint64_t generation_ = 0;      // counts the changes of the maps
  std::optional<Command> rezero_;     // in progress, …
  std::int64_t rezero_since_ns_ = 0;  // … since when
  std::uint64_t reference_sequence_ = 0;
};

}  // namespace dtact::pipeline
