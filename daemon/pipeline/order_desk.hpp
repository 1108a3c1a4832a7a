#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "daemon/pipeline/active_calibration.hpp"
#include "daemon/pipeline/depth/depth_maker.hpp"
#include "daemon/pipeline/exchange.hpp"
#include "daemon/pipeline/teller.hpp"
#include "daemon/pipeline/untouched/untouched_image.hpp"

namespace dtact::pipeline {

/// Takes the network's orders, one at a time, has them done and answers them. Owns the calibration
/// in use, which changes by order only. Capture thread only.
class OrderDesk {
 public:
  OrderDesk(Exchange& exchange, Teller& teller, UntouchedImage& untouched, DepthMaker& depth)
      : exchange_(exchange), teller_(teller), untouched_(untouched), depth_(depth) {}

  /// The calibration to begin with; null: uncalibrated.
  void begin(std::unique_ptr<ActiveCalibration> active) noexcept;
  void take(bool camera_away, const Stamp& now) noexcept;
  /// The untouched image is another, whose last frame this was.
  void reference_taken(std::uint64_t sequence) noexcept { reference_sequence_ = sequence; }
  /// Answers the re-zero under way.
  void answer(RezeroResult result) noexcept;
  /// No frames come: the re-zero under way, if there is one, is given up.
  void give_up_rezero() noexcept;

  /// What a frame is measured by; null: uncalibrated.
  [[nodiscard]] const ActiveCalibration* active() const noexcept { return active_.get(); }

 private:
  void execute(const RezeroOrder& order, bool camera_away) noexcept;
  void execute(CalibrationOrder& order, const Stamp& now) noexcept;
  void execute(const ReferenceOrder& order) noexcept;
  void use() noexcept;
  void use_maps() noexcept;
  void answer(Outcome outcome, const char* sentence) noexcept;

  Exchange& exchange_;
  Teller& teller_;
  UntouchedImage& untouched_;
  DepthMaker& depth_;
  std::unique_ptr<ActiveCalibration> active_;
  std::optional<std::uint64_t> rezero_;  // ticket of the one under way
  std::uint64_t reference_sequence_ = 0;
};

}  // namespace dtact::pipeline
