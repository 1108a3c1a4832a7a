#pragma once

#include <cstdint>
#include <optional>

#include "proto/dtact.pb.h"

namespace dtact::perceive {

/// Keeps the newest frame until it is taken, and a summary of the frames that it replaced.
class NewestFrame {
 public:
  struct Taken {
    v1::Frame frame;
    /// Frames since the one taken before that were replaced, or that the daemon dropped.
    std::uint64_t missed = 0;
    /// The contact may differ from that of the frame taken before: one of the missed frames had no
    /// contact, or the connection was lost in between.
    bool parted = false;
  };

  void put(v1::Frame frame);
  /// The connection was made anew: what was not taken is dropped.
  void part();
  [[nodiscard]] std::optional<Taken> take();

 private:
  std::optional<Taken> newest_;
  std::uint64_t dropped_ = 0;  ///< Frame.dropped of the newest one: counted for each connection.
  bool parted_ = false;
};

}  // namespace dtact::perceive
