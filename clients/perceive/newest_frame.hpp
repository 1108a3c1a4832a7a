#pragma once

#include <cstdint>
#include <optional>

#include "proto/dtact.pb.h"

namespace dtact::perceive {

/// The newest of the frames that come, until it is taken, and what the ones said that it replaced.
class NewestFrame {
 public:
  struct Taken {
    v1::Frame frame;
    std::uint64_t missed = 0;  ///< That came after the one before and were replaced.
    /// What touches may be another contact than in the frame taken before: there was no contact in
    /// one of those that were missed, or they came by another connection.
    bool parted = false;
  };

  void put(v1::Frame frame);
  /// The connection was made anew: what was not taken is dropped.
  void part();
  [[nodiscard]] std::optional<Taken> take();

 private:
  std::optional<Taken> newest_;
  bool parted_ = false;
};

}  // namespace dtact::perceive
