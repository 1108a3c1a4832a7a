#pragma once

#include <cstddef>
#include <deque>
#include <optional>
#include <string>

#include "daemon/net/depth_view.hpp"
#include "daemon/pipeline/depth_frame.hpp"
#include "proto/depth_encoding.hpp"

namespace dtact::net {

/// Pixels of the calibration's resolution that are sent around a contact.
inline constexpr int kContactMargin = 16;

/// The box around what is pressed deeper than the contact threshold, kContactMargin larger on each
/// side and not cut at the map's far borders. Nothing without contact.
[[nodiscard]] std::optional<DepthRegion> contact_box(const pipeline::DepthFrame& frame);

/// The depth maps of one frame as clients asked for them: each view is made once, whatever
/// encodings it is sent in, and each of its encodings once. Buffers are used again with the next
/// frame.
class DepthMaps {
 public:
  /// Begins another frame, which must stay as it is until the next call.
  void begin(const pipeline::DepthFrame& frame) noexcept;
  /// Gives the buffers back. Between two frames only: what get() gave is gone.
  void forget() noexcept;

  struct Map {
    std::string head;  ///< dtact.v1.DepthMap without `data`.
    std::string data;
  };
  /// `encoding`: dtact.v1.DepthEncoding, not 0. Null when the frame has no such map. Valid until
  /// the next begin().
  [[nodiscard]] const Map* get(int encoding, const DepthSpec& spec, bool contact_box);

 private:
  struct View {
    DepthSpec spec;
    bool contact_box = false;
    DepthViewer viewer;
    std::optional<DepthView> made;
  };
  struct Encoded {
    const View* view = nullptr;
    int encoding = 0;
    Map map;
  };
  const View& view(const DepthSpec& spec, bool contact_box);
  void encode(const DepthView& view, int encoding, Map& map);

  const pipeline::DepthFrame* frame_ = nullptr;
  // The first ones of each hold this frame's; a deque, so that they do not move.
  std::deque<View> views_;
  std::size_t views_made_ = 0;
  std::deque<Encoded> encoded_;
  std::size_t encoded_made_ = 0;
  wire::DepthEncoder encoder_;
};

}  // namespace dtact::net
