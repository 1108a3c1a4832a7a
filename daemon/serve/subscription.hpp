#pragma once

#include <cstdint>
#include <variant>

#include "daemon/serve/frame_kind.hpp"
#include "daemon/serve/refusal.hpp"

namespace dtact::v1 {
class Subscribe;
}

namespace dtact::net {

/// Limits the rate to this number per second, as evenly as the frames allow. Passes the frame
/// nearest to each period's time, so that neither the camera's jitter nor a rate that is no whole
/// fraction of the camera's changes the number. Does not make up for a pause, and begins anew when
/// the clock goes back.
class RateLimit {
 public:
  /// 0: no limit.
  explicit RateLimit(double hz = 0);

  [[nodiscard]] bool limits() const noexcept { return period_ns_ > 0; }
  /// The frame of this moment is let through. `spacing_ns`: since the one before, let through or
  /// not; 0 = there was none.
  [[nodiscard]] bool admits(std::int64_t timestamp_ns, std::int64_t spacing_ns) noexcept;

 private:
  std::int64_t period_ns_;
  std::int64_t next_ns_ = INT64_MIN;
};

/// Which parts a program has besides the summary; the other ones are refused.
enum class Serves : std::uint8_t {
  images,     ///< Depth, luma and JPEG: dtactd.
  geometry,   ///< Point clouds, poses and recognition: dtact-perceive.
  everything  ///< What those do that stand behind it: dtact-web.
};

/// What a client wants and when it is due, see dtact.v1.Subscribe.
class Subscription {
 public:
  /// Nothing but events.
  Subscription() = default;
  /// The request, or why not. `map`: pixels of the calibration's depth map at full resolution; 0 =
  /// not known.
  struct Map {
    std::uint32_t width = 0;
    std::uint32_t height = 0;
  };
  [[nodiscard]] static std::variant<Subscription, Refusal> from(const v1::Subscribe& request,
                                                                Map map,
                                                                Serves serves = Serves::images);

  /// Parts of a frame message. A set of bits.
  using Parts = std::uint8_t;
  static constexpr Parts kSummary = 1;
  static constexpr Parts kDepth = 2;
  static constexpr Parts kLuma = 4;
  static constexpr Parts kJpeg = 8;
  static constexpr Parts kCloud = 16;
  static constexpr Parts kPose = 32;
  static constexpr Parts kRecognition = 64;

  struct Due {
    Parts parts = 0;           ///< 0: no message.
    std::uint64_t missed = 0;  ///< Messages that were due before.
  };
  /// One more frame came out of the pipeline, after `missed` unfetched ones.
  [[nodiscard]] Due next(std::int64_t timestamp_ns, std::uint64_t missed) noexcept;

  /// All that is asked for.
  [[nodiscard]] Parts parts() const noexcept { return parts_; }
  [[nodiscard]] bool events() const noexcept { return events_; }
  /// The message that holds these parts.
  [[nodiscard]] FrameKind kind(Parts parts) const;

 private:
  Parts parts_ = 0;
  FrameKind kind_;
  std::uint32_t every_ = 1;
  RateLimit summary_;
  RateLimit depth_;
  RateLimit luma_;
  RateLimit jpeg_;
  RateLimit cloud_;
  RateLimit pose_;
  RateLimit recognition_;
  bool events_ = true;
  bool unlimited_ = false;     ///< One part at least comes with every frame that `every_` leaves.
  std::uint64_t offered_ = 0;  ///< Frames of the pipeline, for `every_`.
  std::int64_t last_ns_ = 0;   ///< The last frame that passed `every_`.
};

}  // namespace dtact::net
